# What other projects embed, for find_package(icbench): the targets icbench::core and icbench::caches.
set_target_properties(icbench_core PROPERTIES EXPORT_NAME core)
set_target_properties(icbench_caches PROPERTIES EXPORT_NAME caches)
set_target_properties(icbench_lanes PROPERTIES EXPORT_NAME lanes)

include(CMakePackageConfigHelpers)
set(destination ${CMAKE_INSTALL_LIBDIR}/cmake/icbench)
install(TARGETS icbench_core icbench_caches icbench_lanes EXPORT icbench)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/core ${PROJECT_SOURCE_DIR}/src/caches
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/icbench FILES_MATCHING PATTERN "*.h")
# Installed, headers find each other by where they lie, so that no folder `core` of a renderer comes in between.
install(CODE "set(includes \"${CMAKE_INSTALL_INCLUDEDIR}\")")
install(CODE [[
  if(NOT IS_ABSOLUTE "${includes}")
    string(PREPEND includes "${CMAKE_INSTALL_PREFIX}/")
  endif()
  file(GLOB headers "$ENV{DESTDIR}${includes}/icbench/core/*.h" "$ENV{DESTDIR}${includes}/icbench/caches/*.h")
  foreach(header ${headers})
    file(READ "${header}" text)
    string(REGEX REPLACE "#include \"(core|caches)/" "#include \"../\\1/" text "${text}")
    file(WRITE "${header}" "${text}")
  endforeach()
]])
install(EXPORT icbench NAMESPACE icbench:: FILE icbench-targets.cmake DESTINATION ${destination})
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/icbench-config.cmake.in
                              ${PROJECT_BINARY_DIR}/icbench-config.cmake INSTALL_DESTINATION ${destination}
                              NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/icbench-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/icbench-config.cmake ${PROJECT_BINARY_DIR}/icbench-config-version.cmake
        DESTINATION ${destination})

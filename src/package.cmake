# What other projects embed, for find_package(icbench): the targets icbench::core and icbench::caches.
set_target_properties(icbench_core PROPERTIES EXPORT_NAME core)
set_target_properties(icbench_caches PROPERTIES EXPORT_NAME caches)
set_target_properties(icbench_lanes PROPERTIES EXPORT_NAME lanes)

include(CMakePackageConfigHelpers)
set(destination ${CMAKE_INSTALL_LIBDIR}/cmake/icbench)
install(TARGETS icbench_core icbench_caches icbench_lanes EXPORT icbench)
# Installed, headers find each other by where they lie, so that no folder `core` of a renderer comes in between. They
# are written so beside the build and not where they are installed, which may be links to where they came from.
set(headers ${PROJECT_BINARY_DIR}/headers)
install(CODE "set(sources \"${PROJECT_SOURCE_DIR}/src\")")
install(CODE "set(headers \"${headers}\")")
install(CODE [[
  file(REMOVE_RECURSE "${headers}")
  string(REPLACE "[" "[[]" pattern "${sources}")
  file(GLOB names RELATIVE "${sources}" "${pattern}/core/*.h" "${pattern}/caches/*.h")
  foreach(name ${names})
    file(READ "${sources}/${name}" text)
    string(REGEX REPLACE "#include \"(core|caches)/" "#include \"../\\1/" text "${text}")
    file(WRITE "${headers}/${name}" "${text}")
  endforeach()
]])
install(DIRECTORY ${headers}/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/icbench)
install(EXPORT icbench NAMESPACE icbench:: FILE icbench-targets.cmake DESTINATION ${destination})
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/icbench-config.cmake.in
                              ${PROJECT_BINARY_DIR}/icbench-config.cmake INSTALL_DESTINATION ${destination}
                              NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/icbench-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/icbench-config.cmake ${PROJECT_BINARY_DIR}/icbench-config-version.cmake
        DESTINATION ${destination})

# What other projects embed, for find_package(icbench): the targets icbench::core and icbench::caches.
set_target_properties(icbench_core PROPERTIES EXPORT_NAME core)
set_target_properties(icbench_caches PROPERTIES EXPORT_NAME caches)
set_target_properties(icbench_lanes PROPERTIES EXPORT_NAME lanes)

include(CMakePackageConfigHelpers)
set(destination ${CMAKE_INSTALL_LIBDIR}/cmake/icbench)
install(TARGETS icbench_core icbench_caches icbench_lanes EXPORT icbench)
install(DIRECTORY ${CMAKE_SOURCE_DIR}/src/core ${CMAKE_SOURCE_DIR}/src/caches
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/icbench FILES_MATCHING PATTERN "*.h")
install(EXPORT icbench NAMESPACE icbench:: FILE icbench-targets.cmake DESTINATION ${destination})
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/icbench-config.cmake.in
                              ${CMAKE_BINARY_DIR}/icbench-config.cmake INSTALL_DESTINATION ${destination}
                              NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/icbench-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/icbench-config.cmake ${CMAKE_BINARY_DIR}/icbench-config-version.cmake
        DESTINATION ${destination})

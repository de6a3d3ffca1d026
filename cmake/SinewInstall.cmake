# `cmake --install`: the program, the headers, and find_package(sinew CONFIG) with target sinew::sinew.
include(CMakePackageConfigHelpers)

add_library(sinew_everything INTERFACE)
target_link_libraries(sinew_everything INTERFACE io pipeline skeleton solver)
set_target_properties(sinew_everything PROPERTIES EXPORT_NAME sinew)
add_library(sinew::sinew ALIAS sinew_everything)
install(TARGETS sinew_everything EXPORT sinewTargets)

set(SINEW_CONFIG_FOLDER ${CMAKE_INSTALL_LIBDIR}/cmake/sinew)
install(EXPORT sinewTargets NAMESPACE sinew:: DESTINATION ${SINEW_CONFIG_FOLDER})
configure_package_config_file(cmake/sinewConfig.cmake.in ${PROJECT_BINARY_DIR}/sinewConfig.cmake
                              INSTALL_DESTINATION ${SINEW_CONFIG_FOLDER})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/sinewConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/sinewConfig.cmake ${PROJECT_BINARY_DIR}/sinewConfigVersion.cmake
        DESTINATION ${SINEW_CONFIG_FOLDER})

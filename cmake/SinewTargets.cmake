# What every target of ours shares: warnings, optimisation, sanitizers, and how it is installed.

add_library(sinew_options INTERFACE)
# -Wno-restrict: GCC 12 warns falsely inside std::string operator+ (its bug 105651). The other two: it warns
# falsely inside its own AVX-512 intrinsics once Eigen uses them (its bugs 105593 and 105616).
target_compile_options(sinew_options INTERFACE -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion
                                               -Wno-restrict -Wno-array-bounds -Wno-maybe-uninitialized)
if(SINEW_WARNINGS_ARE_ERRORS)
  target_compile_options(sinew_options INTERFACE -Werror)
endif()

add_library(sinew_code_generation INTERFACE)
if(CMAKE_BUILD_TYPE STREQUAL "Release" OR CMAKE_BUILD_TYPE STREQUAL "RelWithDebInfo")
  target_compile_options(sinew_code_generation INTERFACE -O3)
endif()
if(SINEW_NATIVE)
  target_compile_options(sinew_code_generation INTERFACE -march=native)
endif()
if(SINEW_SANITIZE)
  target_compile_options(sinew_code_generation INTERFACE -fsanitize=${SINEW_SANITIZE} -fno-sanitize-recover=all
                                                         -fno-omit-frame-pointer)
  target_link_options(sinew_code_generation INTERFACE -fsanitize=${SINEW_SANITIZE})
endif()

# sinew_library(<folder> SOURCES ... HEADERS ... LINKS ...  PRIVATE_LINKS ...)
# One target a folder, named after it; its links are the folders it may include.
function(sinew_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;HEADERS;LINKS;PRIVATE_LINKS" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  add_library(sinew::${name} ALIAS ${name})
  set_target_properties(${name} PROPERTIES OUTPUT_NAME sinew_${name})
  target_compile_features(${name} PUBLIC cxx_std_20)
  # Eigen aligns its memory as the compiler's flags suggest; whoever links us must align it as we do,
  # with -march=native or without.
  target_compile_definitions(${name} PUBLIC EIGEN_MAX_ALIGN_BYTES=32)
  target_include_directories(${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/sinew>)
  target_link_libraries(${name} PUBLIC ${ARG_LINKS}
    PRIVATE $<BUILD_INTERFACE:sinew_options> $<BUILD_INTERFACE:sinew_code_generation> ${ARG_PRIVATE_LINKS})
  install(TARGETS ${name} EXPORT sinewTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(FILES ${ARG_HEADERS} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/sinew/${name})
endfunction()

# sinew_test(<name> SOURCES ... LINKS ...): one test program, linked against what it tests alone.
function(sinew_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINKS} GTest::gtest GTest::gtest_main
                                        sinew_options sinew_code_generation)
  target_compile_definitions(${name} PRIVATE SINEW_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
                                             SINEW_SHARED_DATA="${PROJECT_SOURCE_DIR}/../shared/data")
  gtest_discover_tests(${name} TEST_PREFIX "${name}." DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT 600)
endfunction()

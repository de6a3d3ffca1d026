# `cmake --install`: the program, the headers, and find_package(sinew CONFIG) with target sinew::sinew.
include(CMakePackageConfigHelpers)

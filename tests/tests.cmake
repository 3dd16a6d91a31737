# SPDX-License-Identifier: Apache-2.0
# The programs of tests and what ctest runs of them.

# A program of tests from some of the files; BOXES are what it tests.
function(braid_test_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;BOXES" ${ARGN})
  add_executable(${name} tests/main.cpp ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_BOXES} braid_linked_images braid_flags braid_fewer_checks doctest::doctest)
  target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-Og>)  # what they test is not in these files
  # An assertion as one call: a quarter less to compile.
  target_compile_definitions(${name} PRIVATE DOCTEST_CONFIG_SUPER_FAST_ASSERTS BRAID_SOURCE_DIR="${CMAKE_SOURCE_DIR}" BRAID_BINARY="$<TARGET_FILE:braid>")
  target_precompile_headers(${name} PRIVATE <doctest/doctest.h> <nlohmann/json.hpp> <fmt/format.h> <algorithm> <cmath>
                            <filesystem> <fstream> <functional> <map> <memory> <string> <vector>)
  # Each file has a namespace of its own, so that any of them compile together: in half the time.
  set_target_properties(${name} PROPERTIES UNITY_BUILD_BATCH_SIZE 8)
  if(CMAKE_INTERPROCEDURAL_OPTIMIZATION)  # tests link in a second from the machine code of the fat objects
    set_target_properties(${name} PROPERTIES INTERPROCEDURAL_OPTIMIZATION OFF)
    target_link_options(${name} PRIVATE -fno-lto)
  endif()
endfunction()
set_source_files_properties(tests/main.cpp PROPERTIES SKIP_PRECOMPILE_HEADERS ON)  # it implements doctest
if(TARGET braid_image_module)
  set_source_files_properties(tests/tools/images/test_image_module.cpp PROPERTIES COMPILE_DEFINITIONS BRAID_IMAGE_MODULE="$<TARGET_FILE:braid_image_module>")
endif()
set_source_files_properties(tests/main.cpp tests/support/counted_memory.cpp PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)

# What also runs under sanitizers, where long statistics would take too long; nothing else is built there. What reads
# strangers' files and renders them shortly is a program of its own, that needs neither combiners nor command line.
set(loading "(gltf|fuzz|texture|film|exr|state|registry|scene)")
set(sanitized "(metrics|cli|pw|combiner_stability|cross_half_bias|photon_map_shrinkage|lone_fireflies|own_halves|refilter|rendering_revision|networks|network_file|window_cells|kpn|tza)")
file(GLOB_RECURSE test_sources CONFIGURE_DEPENDS tests/test_*.cpp)
set(loading_sources ${test_sources})
list(FILTER loading_sources INCLUDE REGEX "/test_${loading}[^/]*\\.cpp$")
if(BRAID_SANITIZE)
  list(FILTER test_sources INCLUDE REGEX "/test_${sanitized}[^/]*\\.cpp$")
  braid_test_program(braid_loading_tests SOURCES ${loading_sources} tests/fuzz/targets.cpp
                     braid/braid.cpp tools/bench/builtin_scenes.cpp tools/images/braid_image.cpp tools/images/estimates_file.cpp tools/images/foreign_image.cpp tools/images/same_view.cpp
                     combiners/denoise/oidn/oidn_unet.cpp combiners/learned/network.cpp combiners/learned/tza.cpp combiners/learned/weights_file.cpp
                     combiners/pipeline/exposure.cpp combiners/pipeline/invalid_pixels.cpp combiners/pipeline/spatial_variance.cpp
                     combiners/statistics/surface_smooth.cpp BOXES braid_integrators)
  braid_test_program(braid_tests SOURCES ${test_sources} BOXES braid_tools)
else()
  braid_test_program(braid_tests SOURCES ${test_sources} tests/support/counted_memory.cpp tests/fuzz/targets.cpp BOXES braid_tools)
endif()
add_dependencies(braid_tests braid)
# One ctest per file. What counts errors over many images meets nothing under sanitizers that other cases do not.
set(left_out)
if(BRAID_SANITIZE)
  set(left_out --test-suite-exclude=statistics)
  list(APPEND test_sources ${loading_sources})
endif()
foreach(source IN LISTS test_sources)
  get_filename_component(name ${source} NAME_WE)
  set(program braid_tests)
  if(BRAID_SANITIZE AND source IN_LIST loading_sources)
    set(program braid_loading_tests)
  endif()
  add_test(NAME ${name} COMMAND ${program} --source-file=*${name}.cpp --minimal ${left_out})
  set_tests_properties(${name} PROPERTIES TIMEOUT 600)
  if(name MATCHES "^test_(bdpt|registry|registry_images|cli|cli_images|calibration)$")
    set_tests_properties(${name} PROPERTIES COST 100)  # the longest ones begin first
  endif()
  if(source IN_LIST loading_sources)
    set_tests_properties(${name} PROPERTIES LABELS loading)
  endif()
endforeach()
if(NOT BRAID_SANITIZE)
  add_test(NAME consumer COMMAND ${CMAKE_COMMAND} -DBUILD=${CMAKE_BINARY_DIR} -DWORK=${CMAKE_BINARY_DIR}/consumer
           -DGENERATOR=${CMAKE_GENERATOR} -DCOMPILER=${CMAKE_CXX_COMPILER} -DSCENE=${CMAKE_SOURCE_DIR}/scenes/cornell.glb
           -P ${CMAKE_SOURCE_DIR}/tests/consumer/run.cmake)
  set_tests_properties(consumer PROPERTIES TIMEOUT 600)
  add_test(NAME train COMMAND python3 ${CMAKE_SOURCE_DIR}/tools/train/check.py $<TARGET_FILE:braid>)
  set_tests_properties(train PROPERTIES TIMEOUT 600)
  find_program(BLENDER blender)
  if(BLENDER)
    add_test(NAME blender COMMAND ${BLENDER} -b --factory-startup --python-exit-code 1 -P ${CMAKE_SOURCE_DIR}/tests/blender/press_f12.py)
    set_tests_properties(blender PROPERTIES TIMEOUT 600 ENVIRONMENT "BRAID=$<TARGET_FILE:braid>")
  endif()
  if(TARGET braid_python)
    add_test(NAME python COMMAND ${Python3_EXECUTABLE} ${CMAKE_SOURCE_DIR}/tests/python/test_python.py)
    set_tests_properties(python PROPERTIES TIMEOUT 600
                         ENVIRONMENT "PYTHONPATH=${CMAKE_BINARY_DIR}/python;BRAID=$<TARGET_FILE:braid>")
  endif()
endif()

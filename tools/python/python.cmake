# SPDX-License-Identifier: Apache-2.0
# The package braid for Debian's Python, in python/ of the build: PYTHONPATH=build/release/python. Left out where
# pybind11 or Python's headers are not installed (tools/setup python).
set(Python3_FIND_STRATEGY LOCATION)
set(Python3_ROOT_DIR /usr)
find_package(Python3 QUIET COMPONENTS Interpreter Development.Module)
find_path(PYBIND11_INCLUDE_DIR pybind11/pybind11.h)
if(NOT Python3_Development.Module_FOUND OR NOT PYBIND11_INCLUDE_DIR)
  return()
endif()

file(GLOB python_sources CONFIGURE_DEPENDS tools/python/*.cpp)
add_library(braid_python MODULE ${python_sources})
target_include_directories(braid_python SYSTEM PRIVATE ${PYBIND11_INCLUDE_DIR})
target_link_libraries(braid_python PRIVATE braid_tools braid_linked_images Python3::Module braid_flags)
# Other code of the process sees none of it. It is linked without the optimisation that takes minutes.
target_link_options(braid_python PRIVATE -fno-lto -Wl,--exclude-libs,ALL)
set(python_package ${CMAKE_BINARY_DIR}/python/braid)
set_target_properties(braid_python PROPERTIES PREFIX "" OUTPUT_NAME _braid SUFFIX .so CXX_VISIBILITY_PRESET hidden
                      VISIBILITY_INLINES_HIDDEN ON INTERPROCEDURAL_OPTIMIZATION OFF UNITY_BUILD OFF
                      LIBRARY_OUTPUT_DIRECTORY ${python_package})
file(MAKE_DIRECTORY ${python_package})
foreach(file __init__.py external.py py.typed)
  file(CREATE_LINK ${CMAKE_SOURCE_DIR}/tools/python/braid/${file} ${python_package}/${file} SYMBOLIC)
endforeach()
# What networks need lies beside the module.
foreach(method kpn js_neural double_shrinkage_neural)
  file(CREATE_LINK ${CMAKE_BINARY_DIR}/braid_${method}.network ${python_package}/braid_${method}.network SYMBOLIC)
endforeach()
if(TARGET braid_onednn)
  add_dependencies(braid_python braid_onednn)
  file(CREATE_LINK ${CMAKE_BINARY_DIR}/braid_onednn.so ${python_package}/braid_onednn.so SYMBOLIC)
endif()
set(python_install lib/python3/dist-packages/braid)
install(TARGETS braid_python DESTINATION ${python_install} COMPONENT python)
install(FILES tools/python/braid/__init__.py tools/python/braid/external.py tools/python/braid/py.typed DESTINATION ${python_install} COMPONENT python)

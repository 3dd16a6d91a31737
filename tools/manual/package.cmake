# SPDX-License-Identifier: Apache-2.0
# What tools/package makes of the installed files: a Debian package for each component.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR braid)
set(CPACK_PACKAGE_CONTACT "${BRAID_PACKAGER}")
set(CPACK_DEBIAN_PACKAGE_HOMEPAGE "")
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_COMPONENTS_ALL program library python)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME braid)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION graphics)
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION
    "path tracer with built-in combiners\n Renders glTF 2.0 scenes to converged OpenEXR images on the CPU.")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libbraid-dev)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libdevel)
set(CPACK_COMPONENT_LIBRARY_DESCRIPTION
    "library of the path tracer braid\n Headers and static libraries to load, plan, render and combine.")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_DEPENDS
    "libembree-dev, libopenimageio-dev, libavif-dev, libimath-dev, libtbb-dev, libglm-dev, libboost-dev, libfmt-dev, libwebp-dev, nlohmann-json3-dev, libdraco-dev, libmeshoptimizer-dev, libutf8proc-dev")
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-braid)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "braid, python3 (>= 3.11), python3 (<< 3.12), python3-numpy")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION
    "path tracer braid for Python\n Scenes, renders and combinations, with planes as numpy arrays.")
# By tools/package, after the build.
set(documents ${CMAKE_BINARY_DIR}/documents)
install(DIRECTORY ${documents}/man/ DESTINATION share/man/man1 COMPONENT program)
install(FILES ${documents}/bash/braid DESTINATION share/bash-completion/completions COMPONENT program)
install(FILES ${documents}/zsh/_braid DESTINATION share/zsh/vendor-completions COMPONENT program)
install(DIRECTORY ${documents}/doc/braid DESTINATION share/doc COMPONENT program)
install(DIRECTORY ${documents}/doc/libbraid-dev DESTINATION share/doc COMPONENT library)
install(DIRECTORY ${documents}/doc/python3-braid DESTINATION share/doc COMPONENT python)
include(CPack)

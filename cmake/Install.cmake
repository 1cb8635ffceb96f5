# cmake --install, find_package(terrode) and the Debian package (cpack -G DEB in the build folder).
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)  # what is there is installed; tests need not be built
set(TERRODE_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/terrode)
get_property(terrode_rooms GLOBAL PROPERTY TERRODE_ROOMS)
list(REMOVE_ITEM terrode_rooms cli)  # the program's own
set(terrode_targets terrode_hdf5 terrode_urdfdom)
if(TERRODE_LIGGGHTS_FOUND)
  list(APPEND terrode_targets terrode_mpi)
  set_target_properties(terrode_mpi PROPERTIES EXPORT_NAME mpi)
endif()
foreach(room IN LISTS terrode_rooms)
  list(APPEND terrode_targets terrode_${room})
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/${room} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/terrode
    FILES_MATCHING PATTERN "*.h")
endforeach()
set_target_properties(terrode_hdf5 PROPERTIES EXPORT_NAME hdf5)
set_target_properties(terrode_urdfdom PROPERTIES EXPORT_NAME urdfdom)
install(TARGETS ${terrode_targets} EXPORT terrode ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/terrode)
install(EXPORT terrode NAMESPACE terrode:: FILE terrodeTargets.cmake DESTINATION ${TERRODE_CMAKE_DIR})
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/terrodeConfig.cmake.in
  ${CMAKE_BINARY_DIR}/generated/terrodeConfig.cmake INSTALL_DESTINATION ${TERRODE_CMAKE_DIR})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/generated/terrodeConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/generated/terrodeConfig.cmake ${CMAKE_BINARY_DIR}/generated/terrodeConfigVersion.cmake
  DESTINATION ${TERRODE_CMAKE_DIR})

# The manual page and the shell completion come from the program itself.
if(TARGET terrode_program)
  add_custom_command(OUTPUT ${CMAKE_BINARY_DIR}/generated/terrode.1 ${CMAKE_BINARY_DIR}/generated/terrode.bash
    COMMAND terrode_program man > ${CMAKE_BINARY_DIR}/generated/terrode.1
    COMMAND terrode_program completion bash > ${CMAKE_BINARY_DIR}/generated/terrode.bash
    DEPENDS terrode_program VERBATIM)
  add_custom_target(terrode_manual ALL
    DEPENDS ${CMAKE_BINARY_DIR}/generated/terrode.1 ${CMAKE_BINARY_DIR}/generated/terrode.bash)
  install(FILES ${CMAKE_BINARY_DIR}/generated/terrode.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
  install(FILES ${CMAKE_BINARY_DIR}/generated/terrode.bash
    DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME terrode)
endif()
foreach(folder scenarios soils recordings)
  if(EXISTS ${PROJECT_SOURCE_DIR}/${folder})
    install(DIRECTORY ${PROJECT_SOURCE_DIR}/${folder} DESTINATION ${CMAKE_INSTALL_DATADIR}/terrode)
  endif()
endforeach()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR} FILES_MATCHING PATTERN "*.md")
if(EXISTS ${PROJECT_SOURCE_DIR}/LICENSE)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright)
endif()

if(TERRODE_BUILD_TESTS AND PROJECT_IS_TOP_LEVEL)
  # Installs into a folder of the build tree, then builds and runs examples/own_ode_world against it.
  add_test(NAME install.consumer COMMAND ${CMAKE_COMMAND} -DBUILD=${CMAKE_BINARY_DIR} -DSOURCE=${PROJECT_SOURCE_DIR}
    -DCXX=${CMAKE_CXX_COMPILER} "-DFLAGS=${CMAKE_CXX_FLAGS}"
    -P ${PROJECT_SOURCE_DIR}/tests/install/consumer.cmake)
  set_tests_properties(install.consumer PROPERTIES LABELS "install" TIMEOUT 600)
endif()

if(PROJECT_IS_TOP_LEVEL)
  set(CPACK_PACKAGE_NAME terrode)
  set(CPACK_PACKAGE_VENDOR "The Terrode authors")
  set(CPACK_PACKAGE_CONTACT "The Terrode authors <terrode@localhost>")
  set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "terramechanics of wheels on deformable soil, on the Open Dynamics Engine")
  set(CPACK_PACKAGE_INSTALL_DIRECTORY terrode)
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
  set(CPACK_STRIP_FILES ON)
  set(CPACK_GENERATOR DEB)
  set(CPACK_DEBIAN_PACKAGE_SECTION science)
  set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_PACKAGE_SUGGESTS "libode-dev, libeigen3-dev, libfmt-dev, libgsl-dev, libccd-dev, libyaml-cpp-dev, libmatio-dev, liburdfdom-dev, libhdf5-dev, nlohmann-json3-dev, pkg-config")
  set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
  include(CPack)
endif()

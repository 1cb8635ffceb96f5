# The version and the commit, known to src/core/version.cpp alone.
execute_process(COMMAND git -C ${PROJECT_SOURCE_DIR} describe --always --dirty --abbrev=12
  OUTPUT_VARIABLE TERRODE_COMMIT OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE git_failed)
if(git_failed OR NOT TERRODE_COMMIT)
  set(TERRODE_COMMIT "unknown")
endif()
set_source_files_properties(${PROJECT_SOURCE_DIR}/src/core/version.cpp PROPERTIES
  COMPILE_DEFINITIONS "TERRODE_VERSION=\"${PROJECT_VERSION}\";TERRODE_COMMIT=\"${TERRODE_COMMIT}\"")

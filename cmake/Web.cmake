# What the report pages carry: web/*.css and *.js, and the plotting library uPlot from npm by web/package-lock.json.
# Without npm or without a network the pages keep their static drawings.
option(TERRODE_WEB "Take the plotting library of the report pages from npm at configure time" ON)

set(TERRODE_WEB_DIR ${CMAKE_BINARY_DIR}/web)
set(TERRODE_UPLOT ${TERRODE_WEB_DIR}/node_modules/uplot/dist)
if(TERRODE_WEB)
  file(SHA256 ${PROJECT_SOURCE_DIR}/web/package-lock.json lock_hash)
  set(stamp ${TERRODE_WEB_DIR}/installed)
  set(installed "")
  if(EXISTS ${stamp})
    file(READ ${stamp} installed)
  endif()
  if(NOT installed STREQUAL lock_hash)
    find_program(TERRODE_NPM npm)
    if(TERRODE_NPM)
      file(MAKE_DIRECTORY ${TERRODE_WEB_DIR})
      file(COPY ${PROJECT_SOURCE_DIR}/web/package.json ${PROJECT_SOURCE_DIR}/web/package-lock.json
        DESTINATION ${TERRODE_WEB_DIR})
      execute_process(
        COMMAND ${TERRODE_NPM} ci --ignore-scripts --no-audit --no-fund --prefer-offline --fetch-retries=1
                --fetch-timeout=20000
        WORKING_DIRECTORY ${TERRODE_WEB_DIR} RESULT_VARIABLE npm_failed OUTPUT_QUIET ERROR_QUIET TIMEOUT 90)
      if(npm_failed)
        message(STATUS "npm could not fetch the plotting library: report pages have static figures only")
      else()
        file(WRITE ${stamp} ${lock_hash})
      endif()
    else()
      message(STATUS "npm not found: report pages have static figures only")
    endif()
  endif()
endif()

set(uplot_css "")
set(uplot_js "")
if(TERRODE_WEB AND EXISTS ${TERRODE_UPLOT}/uPlot.iife.min.js)
  set(uplot_css ${TERRODE_UPLOT}/uPlot.min.css)
  set(uplot_js ${TERRODE_UPLOT}/uPlot.iife.min.js)
endif()

set(assets ${CMAKE_BINARY_DIR}/generated/report_assets.cpp)
set(asset_list
  "page_css=${PROJECT_SOURCE_DIR}/web/page.css"
  "page_js=${PROJECT_SOURCE_DIR}/web/page.js"
  "viewer_css=${PROJECT_SOURCE_DIR}/web/viewer.css"
  "viewer_js=${PROJECT_SOURCE_DIR}/web/viewer.js"
  "uplot_css=${uplot_css}"
  "uplot_js=${uplot_js}")
add_custom_command(OUTPUT ${assets}
  COMMAND ${CMAKE_COMMAND} "-DASSETS=${asset_list}" -DOUTPUT=${assets} -P ${PROJECT_SOURCE_DIR}/cmake/EmbedAssets.cmake
  DEPENDS ${PROJECT_SOURCE_DIR}/web/page.css ${PROJECT_SOURCE_DIR}/web/page.js ${PROJECT_SOURCE_DIR}/web/viewer.css
          ${PROJECT_SOURCE_DIR}/web/viewer.js ${uplot_css} ${uplot_js}
          ${PROJECT_SOURCE_DIR}/cmake/EmbedAssets.cmake
  COMMENT "Embedding the scripts and styles of the report pages" VERBATIM)
target_sources(terrode_report PRIVATE ${assets})

if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # Warns falsely about std::string (GCC bug 105651).
  target_compile_options(terrode_report PRIVATE -Wno-restrict)
endif()

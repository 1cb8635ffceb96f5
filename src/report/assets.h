// Style sheets and scripts of the pages, compiled in from web/ (and, where npm was there, from the plotting library).
#pragma once

#include <string_view>

namespace terrode::report::assets {

std::string_view page_css();
std::string_view page_js();
std::string_view viewer_css();
std::string_view viewer_js();
std::string_view uplot_css();   // empty: built without the library
std::string_view uplot_js();

}  // namespace terrode::report::assets

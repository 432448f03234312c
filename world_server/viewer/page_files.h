// SPDX-License-Identifier: MIT
// The page as page/build.mjs bundled it, compiled into the program: nothing is fetched at run time.
#pragma once

#include <span>
#include <string_view>

namespace rikiseki::viewer {

struct PageFile {
  std::string_view path;  // "/", "/viewer.js", ...
  std::string_view type;  // of its content
  std::string_view bytes;
};

std::span<const PageFile> PageFiles();

}  // namespace rikiseki::viewer

#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace perch {

// What the pages of a run and of a calibration have in common: they open offline.

enum class PageScripts {
  kNone,
  kInline,
  kBeside,  // in a file of its own, which the page loads from where it was itself loaded
};

// From the first line to the page's icon, within <head>. `title` is text of ours. The browser itself is told
// that the page may load nothing, and run nothing where it has no scripts.
std::string page_head(const std::string& title, PageScripts scripts);

// JSON for within a <script>: no text in it can end that.
std::string script_json(const nlohmann::ordered_json& json);

}  // namespace perch

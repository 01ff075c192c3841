#include "perch/analysis/page.h"

#include "perch/analysis/summary.h"

namespace perch {

std::string page_head(const std::string& title, PageScripts scripts) {
  // A file has no origin that 'self' could mean in every browser.
  const std::string allowed = scripts == PageScripts::kInline   ? "script-src 'unsafe-inline'; "
                              : scripts == PageScripts::kBeside ? "script-src 'self' file:; "
                                                                : "";
  return R"(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; )" +
         allowed + R"(img-src data:">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>)" +
         title +
         R"(</title>
<link rel="icon" href="data:,">
)";
}

std::string script_json(const nlohmann::ordered_json& json) {
  // "</script>" and "<!--" cannot be in it without a '<'.
  std::string safe;
  for (const char c : to_text(json)) {
    if (c == '<') {
      safe += "\\u003c";
    } else {
      safe += c;
    }
  }
  return safe;
}

}  // namespace perch

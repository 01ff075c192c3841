// perch-target: draws a landing target to scale.

#include <gflags/gflags.h>

#include <iostream>
#include <stdexcept>

#include "perch/target/print.h"
#include "program.h"

DEFINE_string(output, "", "the file to write; its ending says what: .pdf, .svg or .png");
DEFINE_string(paper, "none",
              "none: one page as large as the target; a4, a3, letter: tiles where it is larger");
DEFINE_double(dpi, 300, "resolution of .png, pixels per inch");
DEFINE_bool(bare, false, "the target alone, without margins, cut marks and rulers; with --paper none");

namespace {

constexpr char kDescription[] =
    R"(Draws the target to scale: exact shapes, a grey line and marks where to cut, rulers to check the print's
scale with. Print at 100 %; most dialogs say "fit to page" unless told otherwise.

A target larger than the paper becomes tiles that overlap by 10 mm, and an overview that says how to put
them together: the pages of one .pdf, or files of their own next to the output's name, pad-overview.svg,
pad-r1c1.svg, pad-r1c2.svg, ... The files written are printed, one a line.

A pad that is cut out of white paper and lies on pale ground has an outer edge that cannot be relied on:
say `outer_edge: cut` in its TARGET.yaml.)";

perch::Paper paper_of(const std::string& name) {
  if (name == "none") return perch::Paper::kNone;
  if (name == "a4" || name == "A4") return perch::Paper::kA4;
  if (name == "a3" || name == "A3") return perch::Paper::kA3;
  if (name == "letter") return perch::Paper::kLetter;
  throw perch::UsageError("--paper: expected a4, a3, letter or none, found \"" + name + '"');
}

int run(const perch::CommandLine& line) {
  if (line.arguments.size() != 1) {
    throw perch::UsageError("expected one TARGET.yaml, found " + std::to_string(line.arguments.size()));
  }
  if (FLAGS_output.empty()) throw perch::UsageError("--output: expected a file to write, found nothing");
  // Below 10 a module is hardly a pixel; no printer resolves more than 4800.
  if (!(FLAGS_dpi >= 10 && FLAGS_dpi <= 4800)) throw perch::UsageError("--dpi: expected 10 to 4800");
  if (FLAGS_bare && FLAGS_paper != "none") throw perch::UsageError("--bare: a bare target has no paper");
  const perch::PrintOptions options{paper_of(FLAGS_paper), FLAGS_dpi, FLAGS_bare};
  try {
    const perch::LandingTarget target = perch::read_target(line.arguments.front());
    for (const auto& file : perch::print_target(target, FLAGS_output, options))
      std::cout << file.string() << '\n';
  } catch (const std::invalid_argument& e) {
    throw perch::UsageError(e.what());
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return perch::run_program(argc, argv,
                            {"perch-target", "TARGET.yaml --output pad.pdf [flags]", kDescription}, run);
}

#pragma once

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>
#include <random>
#include <string>
#include <vector>

namespace perch {

// Latencies of runs that took turns, so that whatever else the machine did met all alike: a text file of
// `turn row milliseconds`, to which each turn is appended.
class PairedLatencies {
 public:
  explicit PairedLatencies(const std::string& file) : file_(file) {
    std::ifstream in(file);
    std::string row;
    double ms = 0;
    for (long turn = 0; in >> turn >> std::ws && std::getline(in, row, '\t') && in >> ms;)
      turns_[turn][row].push_back(ms);
  }

  void add(long turn, const std::string& row, const std::vector<double>& ms) {
    std::ofstream out(file_, std::ios::app);
    for (const double value : ms) out << turn << ' ' << row << '\t' << value << '\n';
    turns_[turn][row] = ms;
  }

  // The 99 % of each row over that of `base`, with the middle 95 % of what it is when the turns are drawn
  // again with replacement: neighbours in a turn are not independent, turns are.
  void print(const std::string& base) const {
    std::vector<long> all;
    for (const auto& [turn, rows] : turns_) all.push_back(turn);
    const auto of_base = p99(base, all);
    for (const auto& [row, ms] : turns_.begin()->second) {
      std::vector<double> ratios;
      std::mt19937 random(1);
      for (int i = 0; i < 1000; ++i) {
        std::vector<long> drawn(all.size());
        for (long& turn : drawn) turn = all[random() % all.size()];
        ratios.push_back(p99(row, drawn) / p99(base, drawn));
      }
      std::sort(ratios.begin(), ratios.end());
      std::printf("%s: %zu turns, 99 %% %.2f ms, over that of %s %.2f (%.2f to %.2f)\n", row.c_str(),
                  all.size(), p99(row, all), base.c_str(), p99(row, all) / of_base, ratios[25], ratios[974]);
    }
  }

 private:
  double p99(const std::string& row, const std::vector<long>& turns) const {
    std::vector<double> all;
    for (const long turn : turns) {
      const auto& ms = turns_.at(turn).at(row);
      all.insert(all.end(), ms.begin(), ms.end());
    }
    const auto at = all.begin() + static_cast<std::ptrdiff_t>(all.size() * 99 / 100);
    std::nth_element(all.begin(), at, all.end());
    return *at;
  }

  std::string file_;
  std::map<long, std::map<std::string, std::vector<double>>> turns_;
};

}  // namespace perch

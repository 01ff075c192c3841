#pragma once

#include <locale.h>

#include <clocale>

namespace perch {

// While it lives, this thread's C library reads and writes numbers with a dot. libmrcal reads with sscanf,
// which after setlocale(LC_ALL, "") in a country of decimal commas stops at "0".
class CNumbers {
 public:
  CNumbers() : c_(newlocale(LC_NUMERIC_MASK, "C", nullptr)), before_(uselocale(c_)) {}
  ~CNumbers() {
    uselocale(before_);
    if (c_) freelocale(c_);
  }
  CNumbers(const CNumbers&) = delete;
  CNumbers& operator=(const CNumbers&) = delete;

 private:
  locale_t c_, before_;
};

}  // namespace perch

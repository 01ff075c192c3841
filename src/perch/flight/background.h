#pragma once

#include <sys/resource.h>
#include <unistd.h>

namespace perch {

// Makes the calling thread give way to those that estimate, where a core is short: it gets a third of what
// one of them does. With less, on a machine that others load as well, the recording would lose most pictures.
// On Linux a niceness is a thread's own.
inline void work_in_background() { setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), 5); }

}  // namespace perch

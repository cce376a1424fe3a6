#include "features/memory.h"

#include <cstdlib>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace vantage::features {

void KeepFreedMemory() {
#ifdef __GLIBC__
  constexpr int kOnTheHeap =
      32 << 20;  // Larger blocks are maps of their own, given back when freed; the most that may be asked for.
  constexpr int kKept = 512 << 20;
  mallopt(M_MMAP_THRESHOLD, kOnTheHeap);
  mallopt(M_TRIM_THRESHOLD, kKept);
#endif
}

}  // namespace vantage::features

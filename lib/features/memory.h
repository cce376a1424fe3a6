// Memory that extraction uses for every image is kept by the program.
#pragma once

namespace vantage::features {

// Tells the C library to keep what is freed for the next use. SIFT fills 70 MB for a 640 x 480 image; by default they go back to
// the system after each one and are fetched anew, page by page, in 8 ms and more of its processor time. The program stays as large
// as it was at its largest. For the start of a program's main, as it holds for the whole program; no effect where the C library is
// not GNU's.
void KeepFreedMemory();

}  // namespace vantage::features

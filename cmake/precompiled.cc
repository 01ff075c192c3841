// Nothing: cmake/Perch.cmake precompiles headers with it.

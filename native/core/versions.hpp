// Macros for loops over many numbers.
// FG_VERSIONS: the function is compiled for AVX2 and AVX-512, too; the version is chosen when the library is loaded. All
// versions give the same bits, because none contracts a product and a sum (-ffp-contract=off).
// FG_INDEPENDENT: the arrays that the next loop writes to do not overlap those that it reads.
#pragma once
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GNUC__) && !defined(__clang__) && \
    defined(__OPTIMIZE__) && !defined(__SANITIZE_ADDRESS__)
#define FG_VERSIONS __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define FG_VERSIONS
#endif
#if defined(__clang__)
#define FG_INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#elif defined(__GNUC__)
#define FG_INDEPENDENT _Pragma("GCC ivdep")
#else
#define FG_INDEPENDENT
#endif

/**
 * @file consensus_guard.h
 * @brief Refuses arithmetic that is not plain IEEE 754, since the constants were rounded for that and nothing else.
 *
 * Compile with -ffp-contract=off: GCC ignores the pragma below, Clang obeys it only where no flag says otherwise.
 */
#ifndef CONSENSUS_GUARD_H
#define CONSENSUS_GUARD_H

#include <float.h>

#ifdef __FAST_MATH__
#error "compile without -ffast-math: it reorders sums"
#endif
#if !defined(FLT_EVAL_METHOD) || FLT_EVAL_METHOD != 0
#error "intermediate results must have the type of their operands (on 32-bit x86: -msse2 -mfpmath=sse)"
#endif
#if FLT_RADIX != 2 || DBL_MANT_DIG != 53 || DBL_MAX_EXP != 1024 || FLT_MANT_DIG != 24 || FLT_MAX_EXP != 128
#error "float and double must be binary32 and binary64 of IEEE 754"
#endif
#if !defined(__GNUC__) || defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

/**
 * @brief Tries at run time what the compiler cannot be asked: are products fused, are subnormal numbers flushed?
 * @return 0 if the arithmetic is as it should be, else a sum of 1 (fused products) and 2 (flushed subnormals).
 */
static int consensus_arithmetic_fault(void)
{
    const volatile double above = 0x1.0000001p+0;
    const volatile double below = 0x1.ffffffep-1;
    const volatile float above_f = 0x1.0008p+0f;
    const volatile float below_f = 0x1.fff0p-1f;
    const volatile double tiny = DBL_MIN;
    const volatile float tiny_f = FLT_MIN;
    const double one = 1.0;
    const float one_f = 1.0f;
    const double half = 0.5;
    const float half_f = 0.5f;
    volatile double rest = above * below; /* the product alone, rounded */
    volatile float rest_f = above_f * below_f;
    const volatile double fused = above * below - one; /* loaded anew, so that this product may be fused */
    const volatile float fused_f = above_f * below_f - one_f;
    int fault = 0;

    rest = rest - one;
    rest_f = rest_f - one_f;
    if (fused < rest || fused > rest || fused_f < rest_f || fused_f > rest_f) {
        fault += 1;
    }
    if (!(tiny * half > 0.0) || !(tiny_f * half_f > 0.0f)) {
        fault += 2;
    }
    return fault;
}

#endif

#ifndef MMSMITH_FN
#if defined(__CUDACC__) || defined(__HIPCC__)
#define MMSMITH_FN static inline __host__ __device__
#else
#define MMSMITH_FN static inline
#endif
#endif

#ifndef MMSMITH_RESTRICT
#if defined(__cplusplus)
#define MMSMITH_RESTRICT __restrict
#else
#define MMSMITH_RESTRICT restrict
#endif
#endif

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

#ifndef MMSMITH_SUPPORT
#define MMSMITH_SUPPORT 1

MMSMITH_FN int mmsmith_is_finite(double x)
{
    return x - x == 0.0;
}

/* sin(pi x) for |x| <= 1/4: the minimax polynomial of Sun's fdlibm for the sine, with the powers of pi in its
   coefficients. */
MMSMITH_FN double mmsmith_sine(double x)
{
    const double z = x * x;
    const double square = z * z;
    const double low = -5.1677127800499685 + z * 2.550164039874027;
    const double middle = -5.992645289761195e-1 + z * 8.214587016569905e-2;
    const double high = -7.370034319852937e-3 + z * 4.615949610094388e-4;
    return x * (3.141592653589793 + z * (low + square * (middle + square * high)));
}

/* cos(pi x) for |x| <= 1/4, as the sine. */
MMSMITH_FN double mmsmith_cosine(double x)
{
    const double z = x * x;
    const double square = z * z;
    const double low = 4.058712126416762 + z * -1.3352627688531686;
    const double middle = 2.3533063024398165e-1 + z * -2.5806886826923767e-2;
    const double high = 1.9294787607771144e-3 + z * -1.0362464958654164e-4;
    return (1.0 - 4.934802200544679 * z) + square * (low + square * (middle + square * high));
}

/* sin(pi (x + quarters/2)) for quarters = 0 or 1, within one unit in the last place. */
MMSMITH_FN double mmsmith_sin_pi_shifted(double x, int quarters)
{
    /* x = n/2 + r with |r| <= 1/4; n and r are exact. From one and a half times 2^51 on doubles are multiples of 1/2,
       and from twice that on whole numbers, so that adding them rounds. */
    const double shift = 3377699720527872.0;
    const double whole = 6755399441055744.0;
    double nearest, n, whole_turns, quadrant, r, value;
    int odd, negative;
    if (fabs(x) < 1125899906842624.0) {
        nearest = (x + shift) - shift;
        n = 2.0 * nearest;
        whole_turns = (0.25 * n + whole) - whole;
    } else {
        /* Very large or not a number; both are rare. */
        n = round(2.0 * x);
        nearest = 0.5 * n;
        whole_turns = round(0.25 * n);
    }
    /* One of -2, -1, 0, 1 and 2. */
    quadrant = n - 4.0 * whole_turns;
    r = x - nearest;
    odd = fabs(quadrant) == 1.0;
    if (quarters == 0) {
        negative = quadrant == -1.0 || fabs(quadrant) == 2.0;
    } else {
        negative = quadrant == 1.0 || fabs(quadrant) == 2.0;
        odd = !odd;
    }
    value = odd ? mmsmith_cosine(r) : mmsmith_sine(r);
    return negative ? -value : value;
}

/* sin(pi x); the argument is reduced before it is multiplied by pi, which is exact. */
MMSMITH_FN double mmsmith_sin_pi(double x)
{
    return mmsmith_sin_pi_shifted(x, 0);
}

/* cos(pi x); the argument is reduced before it is multiplied by pi, which is exact. */
MMSMITH_FN double mmsmith_cos_pi(double x)
{
    return mmsmith_sin_pi_shifted(x, 1);
}

#endif

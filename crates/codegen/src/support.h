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

/* The sine for |x| <= pi/4, by the minimax polynomial of Sun's fdlibm. */
MMSMITH_FN double mmsmith_sine(double x)
{
    const double z = x * x;
    const double tail = 8.33333333332249e-3
        + z * (-1.984126982985795e-4 + z * 2.7557313707070068e-6)
        + z * (z * z) * (-2.5050760253406863e-8 + z * 1.58969099521155e-10);
    return x + (z * x) * (-1.6666666666666632e-1 + z * tail);
}

/* The cosine for |x| <= pi/4, by the minimax polynomial of Sun's fdlibm. */
MMSMITH_FN double mmsmith_cosine(double x)
{
    const double z = x * x;
    const double square = z * z;
    const double tail = z
        * (4.16666666666666e-2 + z * (-1.388888888887411e-3 + z * 2.480158728947673e-5))
        + square * square
            * (-2.7557314351390663e-7
                + z * (2.087572321298175e-9 + z * -1.1359647557788195e-11));
    const double half = 0.5 * z;
    const double leading = 1.0 - half;
    /* What the rounding of the leading part left out comes back with the tail. */
    return leading + (((1.0 - leading) - half) + z * tail);
}

/* sin(pi (x + quarters/2)) for quarters = 0 or 1, within one unit in the last place. */
MMSMITH_FN double mmsmith_sin_pi_shifted(double x, int quarters)
{
    /* x = n/2 + r with |r| <= 1/4; n and r are exact. From one and a half times 2^52 on doubles are whole numbers, so
       that adding it rounds. */
    const double shift = 6755399441055744.0;
    const double halves = 2.0 * x;
    double n, whole_turns, quadrant, r, value;
    int odd, negative;
    if (fabs(halves) < 2251799813685248.0) {
        n = (halves + shift) - shift;
        whole_turns = (0.25 * n + shift) - shift;
    } else {
        /* A whole number or not a number; both are rare. */
        n = round(halves);
        whole_turns = round(0.25 * n);
    }
    /* One of -2, -1, 0, 1 and 2. */
    quadrant = n - 4.0 * whole_turns;
    r = (x - n * 0.5) * 3.141592653589793;
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

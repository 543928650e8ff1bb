
#ifndef MMSMITH_LOGARITHM
#define MMSMITH_LOGARITHM 1

/* ln(y) where by_y, else ln(1 + x), by the reduction and the polynomial of Sun's fdlibm. */
MMSMITH_FN double mmsmith_logarithm(double x, double y, int by_y)
{
    const double sum = 1.0 + x;
    const double u = by_y ? y : sum;
    /* What rounding took from the sum. */
    const double lost = by_y ? 0.0 : x - (sum - 1.0);
    double m, f, s, z, w, even, odd, half_square, tail;
    int k;
    if (!(u > 0.0 && u - u == 0.0)) {
        return u == 0.0 ? -HUGE_VAL : u > 0.0 ? u : NAN;
    }
    /* u = 2^k m with m between sqrt(1/2) and sqrt(2). */
    m = frexp(u, &k);
    if (m < 0.7071065902709961) {
        m += m;
        --k;
    }
    /* m - 1 with the digits that the sum has lost; x itself if k = 0. */
    f = (m - 1.0) + ldexp(lost, -k);
    s = f / (2.0 + f);
    z = s * s;
    w = z * z;
    even = w * (3.9999999999409419e-1 + w * (2.2222198432149784e-1 + w * 1.5313837699209373e-1));
    odd = z
        * (6.6666666666667351e-1
            + w * (2.8571428743662391e-1 + w * (1.818357216161805e-1 + w * 1.4798198605116586e-1)));
    half_square = 0.5 * f * f;
    tail = s * (half_square + (even + odd)) + k * 1.9082149292705877e-10;
    return k * 6.931471803691238e-1 - ((half_square - tail) - f);
}

/* ln(1 + x), within one unit in the last place. */
MMSMITH_FN double mmsmith_log_1p(double x)
{
    return mmsmith_logarithm(x, x, 0);
}

/* ln(y) of y = 1 + x: by y where x < -1/2, else by x. */
MMSMITH_FN double mmsmith_ln_of_both(double x, double y)
{
    return mmsmith_logarithm(x, y, x < -0.5);
}

#endif

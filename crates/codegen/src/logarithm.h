
#ifndef MMSMITH_LOGARITHM
#define MMSMITH_LOGARITHM 1

/*
 * h - t of ln(1 + f) = f - (h - t), for f from -1/2 to 1: h = f^2/2, t = s (h + R) with s = f/(2 + f), and R the polynomial of
 * degree ten in s^2 next to 2 artanh(s)/s - 2.
 */
MMSMITH_FN double mmsmith_rest_of_logarithm(double f)
{
    const double s = f / (2.0 + f);
    const double z = s * s;
    const double square = z * z;
    const double fourth = square * square;
    const double a = 6.666666666666631e-1 + z * 4.0000000000157265e-1;
    const double b = 2.857142854785134e-1 + z * 2.222222396988407e-1;
    const double c = 1.818174391978506e-1 + z * 1.538656002655927e-1;
    const double d = 1.3300972308611736e-1 + z * 1.2106095736684865e-1;
    const double e = 8.340062622941338e-2 + z * 1.7018643055517807e-1;
    const double R = z * ((a + square * b) + fourth * ((c + square * d) + fourth * e));
    const double half_square = 0.5 * f * f;
    return half_square - s * (half_square + R);
}

/* ln(y) where by_y, else ln(1 + x); reduced as in Sun's fdlibm, but for arguments near one, which are taken as they are. */
MMSMITH_FN double mmsmith_logarithm(double x, double y, int by_y)
{
    const double sum = 1.0 + x;
    const double u = by_y ? y : sum;
    /* What rounding took from the sum. */
    const double lost = by_y ? 0.0 : x - (sum - 1.0);
    double m, f;
    int k;
    if (x >= -0.5 && x < 1.0) {
        return x - mmsmith_rest_of_logarithm(x);
    }
    if (!(u > 0.0 && u - u == 0.0)) {
        return u == 0.0 ? -HUGE_VAL : u > 0.0 ? u : NAN;
    }
    /* u = 2^k m with m between sqrt(1/2) and sqrt(2). */
    m = frexp(u, &k);
    if (m < 0.7071065902709961) {
        m += m;
        --k;
    }
    /* m - 1, with the digits that the sum has lost. */
    f = (m - 1.0) + ldexp(lost, -k);
    return k * 6.931471803691238e-1
        - ((mmsmith_rest_of_logarithm(f) - k * 1.9082149292705877e-10) - f);
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

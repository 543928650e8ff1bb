
#ifndef MMSMITH_COSH_SQRT
#define MMSMITH_COSH_SQRT 1

/* exp(sqrt(y)). What rounding takes from a large root is many units in the last place of its exponential; the square of its
   halves of 26 bits is exact. */
MMSMITH_FN double mmsmith_exp_sqrt(double y)
{
    const double root = sqrt(y);
    double lost = 0.0;
    if (root < 1e3) {
        const double scaled = root * 134217729.0;
        const double high = scaled - (scaled - root);
        const double low = root - high;
        const double square = root * root;
        const double error = ((high * high - square) + 2.0 * (high * low)) + low * low;
        lost = ((y - square) - error) / (2.0 * root);
    }
    return exp(root) * (1.0 + lost);
}

/* cosh(sqrt(y)) - 1: sum y^k/(2 k)! from k = 1 on, terms of one sign, small where y is small. */
MMSMITH_FN double mmsmith_cosh_sqrt_m1(double y)
{
    if (fabs(y) <= 9.0) {
        double sum = 1.0;
        int k;
        for (k = 16; k > 0; --k) {
            sum = 1.0 + y * sum / ((2.0 * k + 1.0) * (2.0 * k + 2.0));
        }
        return 0.5 * y * sum;
    } else {
        const double exponential = mmsmith_exp_sqrt(y);
        return 0.5 * (exponential + 1.0 / exponential) - 1.0;
    }
}

/* Twice the derivative of that, less one: sinh(s)/s - 1 for s = sqrt(y). */
MMSMITH_FN double mmsmith_cosh_sqrt_m1_slope(double y)
{
    if (fabs(y) <= 9.0) {
        double sum = 1.0;
        int k;
        for (k = 16; k > 0; --k) {
            sum = 1.0 + y * sum / ((2.0 * k + 2.0) * (2.0 * k + 3.0));
        }
        return y * sum / 6.0;
    } else {
        const double exponential = mmsmith_exp_sqrt(y);
        return 0.5 * (exponential - 1.0 / exponential) / sqrt(y) - 1.0;
    }
}

/* The derivative of that, (cosh(s) - sinh(s)/s)/(2 y). */
MMSMITH_FN double mmsmith_cosh_sqrt_m1_curvature(double y)
{
    if (fabs(y) <= 9.0) {
        double sum = 1.0;
        int k;
        for (k = 16; k > 0; --k) {
            sum = 1.0 + y * sum / (2.0 * k * (2.0 * k + 3.0));
        }
        return sum / 6.0;
    } else {
        const double exponential = mmsmith_exp_sqrt(y);
        const double inverse = 1.0 / exponential;
        const double share = 1.0 / sqrt(y);
        /* exp(s) (1 - 1/s) + exp(-s) (1 + 1/s) is twice the numerator. */
        return 0.25 * ((exponential * (1.0 - share) + inverse * (1.0 + share)) / y);
    }
}

#endif

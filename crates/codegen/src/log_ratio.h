
#ifndef MMSMITH_LOG_RATIO
#define MMSMITH_LOG_RATIO 1

/* sinh(arcosh(1 + z)); the square of a large number may be beyond the largest one. */
MMSMITH_FN double mmsmith_hyperbolic_sine(double z)
{
    return z + 2.0 == z ? z : sqrt(z * (z + 2.0));
}

/* arcosh(1 + z), which is ln(2 z) for large z. */
MMSMITH_FN double mmsmith_log_ratio(double z)
{
    return z + 2.0 == z ? log(z) + 0.69314718055994531 : log1p(z + mmsmith_hyperbolic_sine(z));
}

/* arcosh(1 + z)^2, the squared logarithm of the ratio of two stretches a and b for z = (a - b)^2/(2 a b). */
MMSMITH_FN double mmsmith_log_ratio_squared(double z)
{
    const double theta = mmsmith_log_ratio(z);
    return theta * theta;
}

/* Half the derivative of that, less one: theta/sinh(theta) - 1 for theta = arcosh(1 + z). */
MMSMITH_FN double mmsmith_log_ratio_slope(double z)
{
    const double y = z / (z + 2.0);
    double sum = 0.0;
    int k;
    if (y > 0.25) {
        return mmsmith_log_ratio(z) / mmsmith_hyperbolic_sine(z) - 1.0;
    }
    /* -sum 2 y^k/(4 k^2 - 1) from k = 1 on: terms of one sign, small where z is small. */
    for (k = 24; k > 0; --k) {
        sum = sum * y + 2.0 / (4.0 * k * k - 1.0);
    }
    return -sum * y;
}

/* The derivative of that. */
MMSMITH_FN double mmsmith_log_ratio_curvature(double z)
{
    const double y = z / (z + 2.0);
    double sum = 0.0;
    int k;
    if (y > 0.25) {
        /* theta coth(theta) - 1, in which nothing cancels, over sinh(theta)^2. */
        return -((mmsmith_log_ratio(z) * ((1.0 + z) / mmsmith_hyperbolic_sine(z)) - 1.0) / z) / (z + 2.0);
    }
    for (k = 24; k > 0; --k) {
        sum = sum * y + k / (4.0 * k * k - 1.0);
    }
    return -sum * ((1.0 - y) * (1.0 - y));
}

#endif

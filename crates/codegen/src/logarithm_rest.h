
#ifndef MMSMITH_LOGARITHM_REST
#define MMSMITH_LOGARITHM_REST 1

/* ln(1 + x) - x, within four units in the last place. */
MMSMITH_FN double mmsmith_log_1p_minus_x(double x)
{
    if (x >= -0.5 && x < 1.0) {
        return -mmsmith_rest_of_logarithm(x);
    }
    return x == HUGE_VAL ? -HUGE_VAL : mmsmith_logarithm(x, x, 0) - x;
}

#endif


#ifndef MMSMITH_ROUNDING
#define MMSMITH_ROUNDING 1

/* What rounding takes from a sum, exactly (Knuth). */
MMSMITH_FN double mmsmith_sum_error(double a, double b)
{
    const double sum = a + b;
    const double b_in_sum = sum - a;
    return (a - (sum - b_in_sum)) + (b - b_in_sum);
}

/* What rounding takes from a product, exactly (Dekker): by halves of 26 bits, whose products are exact. */
MMSMITH_FN double mmsmith_product_error(double a, double b)
{
    const double a_scaled = a * 134217729.0;
    const double b_scaled = b * 134217729.0;
    const double a_high = a_scaled - (a_scaled - a);
    const double b_high = b_scaled - (b_scaled - b);
    const double a_low = a - a_high;
    const double b_low = b - b_high;
    const double product = a * b;
    return (((a_high * b_high - product) + a_high * b_low) + a_low * b_high) + a_low * b_low;
}

#endif

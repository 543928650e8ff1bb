
#ifndef MMSMITH_POSITIVE_PART
#define MMSMITH_POSITIVE_PART 1

/* max(x, 0), and no number where x is none. */
MMSMITH_FN double mmsmith_positive_part(double x)
{
    return x <= 0.0 ? 0.0 : x;
}

/* Its derivative: 1 where x > 0, else 0. */
MMSMITH_FN double mmsmith_positive_part_slope(double x)
{
    if (x > 0.0) {
        return 1.0;
    }
    return x <= 0.0 ? 0.0 : x;
}

#endif

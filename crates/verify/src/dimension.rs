//! From solutions whose dimension and precision are known at run time to code that is generic over them.

/// `$body` with `$s` bound to the solution in its dimension; `$otherwise` for a dimension that is not known here.
macro_rules! in_dimension {
    ($exact:expr, |$s:ident| $body:expr, else $otherwise:expr) => {{
        use mmsmith_runtime::AnySolution;
        match $exact {
            AnySolution::One(solution) => {
                let $s = solution.as_ref();
                $body
            }
            AnySolution::Two(solution) => {
                let $s = solution.as_ref();
                $body
            }
            AnySolution::Three(solution) => {
                let $s = solution.as_ref();
                $body
            }
            _ => $otherwise,
        }
    }};
}

/// `$body` with `$s` bound to the exact solution, and `$m` to that which drives the solver, in the solver's precision;
/// `$otherwise` where their dimensions differ or are not known here.
macro_rules! in_arithmetic {
    ($exact:expr, $arithmetic:expr, |$s:ident, $m:ident| $body:expr, else $otherwise:expr) => {{
        use mmsmith_runtime::AnySolution::{One, Three, Two};
        #[cfg(feature = "single-precision")]
        use $crate::case::Arithmetic::Single;
        use $crate::case::Arithmetic::Double;
        match ($exact, $arithmetic) {
            (One(s), Double) => in_arithmetic!(@ s, s, $s, $m, $body),
            (Two(s), Double) => in_arithmetic!(@ s, s, $s, $m, $body),
            (Three(s), Double) => in_arithmetic!(@ s, s, $s, $m, $body),
            #[cfg(feature = "single-precision")]
            (One(s), Single(One(m))) => in_arithmetic!(@ s, m, $s, $m, $body),
            #[cfg(feature = "single-precision")]
            (Two(s), Single(Two(m))) => in_arithmetic!(@ s, m, $s, $m, $body),
            #[cfg(feature = "single-precision")]
            (Three(s), Single(Three(m))) => in_arithmetic!(@ s, m, $s, $m, $body),
            _ => $otherwise,
        }
    }};
    (@ $exact:ident, $model:ident, $s:ident, $m:ident, $body:expr) => {{
        let ($s, $m) = ($exact.as_ref(), $model.as_ref());
        $body
    }};
}

pub(crate) use {in_arithmetic, in_dimension};

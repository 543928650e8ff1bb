//! Fortran: the reader of tables, and functions that take values from them.

use crate::code::Code;
use crate::listing::Item;
use crate::table::{BODY_FORCE, FIRST_INTERNAL, Normal, OfTable, STRESS};
use crate::text::fortran_string;

const TABLE: &str = include_str!("table.f90");

const TYPES: &str = "\
  integer, parameter :: most_polynomials = 64
  real(dp), parameter :: not_a_number = transfer(9221120237041090560_int64, 1.0_dp)

  ! Series in time at one position: coefficients of each polynomial of each piece, for each entry of each field.
  type :: series
    private
    real(dp), allocatable :: knots(:), coefficients(:, :, :)
  end type

  ! Fields of position and time: Chebyshev series in coordinates of the body, and in pieces of the time; or series of some points.
  type :: table
    private
    integer :: axes = 0, in_time = 0, points = 0, axis(3) = 1, count(3) = 1
    character :: chart = \"b\", frame = \"c\"
    real(dp) :: low(3) = 0.0_dp, high(3) = 1.0_dp, end = 0.0_dp
    ! For each field its shape and how many entries there are before it.
    character, allocatable :: shape(:)
    integer, allocatable :: first(:)
    real(dp), allocatable :: knots(:), coefficients(:, :), places(:, :)
    type(series), allocatable :: of_points(:)
  end type

";

/// The types of tables and series.
pub(in crate::targets) fn types(code: &Code<'_>) -> &'static str {
    if code.table.is_some() { TYPES } else { "" }
}

/// Names that the module has for its table.
pub(in crate::targets) fn public_names(code: &Code<'_>) -> String {
    if code.table.is_none() {
        return String::new();
    }
    let values = of_series(code).into_iter().map(|(name, ..)| format!(", {name}_of_series"));
    format!("  public :: read_table, series, series_of{}\n", values.collect::<String>())
}

/// The fields of a series: name, words, entries before it, and entries.
fn of_series(code: &Code<'_>) -> Vec<(&'static str, &'static str, usize, usize)> {
    let (d, variables) = (code.spec.dimension, code.variable_count());
    let all = [
        ("b", "body force", 0, d),
        ("P", "first Piola-Kirchhoff stress", d, d * d),
        ("internal", "all internal variables", d + d * d, variables),
    ];
    all.into_iter().filter(|(.., count)| *count > 0).collect()
}

/// The reader, and the fields of a series.
pub(in crate::targets) fn procedures(code: &Code<'_>) -> String {
    let Some(table) = &code.table else { return String::new() };
    let [missing, another, broken] = code.table_messages().map(|message| fortran_string(&message));
    let d = code.spec.dimension;
    let mut text = TABLE
        .replace("DIMENSION", &d.to_string())
        .replace("DIGEST", &table.digest)
        .replace("MISSING", &missing)
        .replace("ANOTHER", &another)
        .replace("BROKEN", &broken);
    for (name, about, first, count) in of_series(code) {
        let entries = format!("table_entries(own, t, {first}, {count})");
        let (shape, value) = match name {
            "P" => (format!("{d}, {d}"), format!("transpose(reshape({entries}, [{d}, {d}]))")),
            _ => (count.to_string(), entries),
        };
        text += &format!(
            "
  ! {about} of a series at a time
  pure function {name}_of_series(own, t) result(values)
    type(series), intent(in) :: own
    real(dp), intent(in) :: t
    real(dp) :: values({shape})
    values = {value}
  end function
"
        );
    }
    text
}

/// A function that takes its values from the table.
pub(in crate::targets) fn item(code: &Code<'_>, item: &Item, of_table: OfTable) -> String {
    let (d, variables) = (code.spec.dimension, code.variable_count());
    let fields = |first: usize, last: usize, count: usize| {
        format!("table_fields(s%fields_of_histories, X, t, {first}, {last}, {count})")
    };
    let (shape, lines) = match of_table {
        OfTable::BodyForce => {
            (format!("({d})"), format!("    values = {}\n", fields(BODY_FORCE, BODY_FORCE, d)))
        }
        OfTable::Stress => (
            format!("({d}, {d})"),
            format!(
                "    values = transpose(reshape({}, [{d}, {d}]))\n",
                fields(STRESS, STRESS, d * d)
            ),
        ),
        OfTable::Internal => {
            let last =
                FIRST_INTERNAL + code.table.as_ref().map_or(0, |table| table.sizes.len()) - 1;
            (
                format!("({variables})"),
                format!("    values = {}\n", fields(FIRST_INTERNAL, last, variables)),
            )
        }
        OfTable::Variable { field, size, entry } => (
            String::new(),
            format!(
                "    real(dp) :: entries({size})\n    entries = {}\n    values = entries({})\n",
                fields(field, field, size),
                entry + 1
            ),
        ),
        OfTable::Traction(surface) => {
            let stress = format!("    real(dp) :: stress({d}, {d})\n    stress = P(s, X, t)\n");
            let (sign, value) = match Normal::of(surface, code.spec, code.is_of_half_plane) {
                Normal::Axis(axis, sign) => (sign, format!("stress(:, {})", axis + 1)),
                Normal::Radial { sign, components } if components == d => {
                    (sign, "matmul(stress, X / norm2(X))".to_owned())
                }
                Normal::Radial { sign, components } => (
                    sign,
                    format!(
                        "matmul(stress(:, :{components}), X(:{components}) / norm2(X(:{components})))"
                    ),
                ),
                Normal::Around(sign) => {
                    (sign, "(stress(:, 2) * X(1) - stress(:, 1) * X(2)) / norm2(X(:2))".to_owned())
                }
            };
            let sign = if sign < 0.0 { "-" } else { "" };
            (format!("({d})"), format!("{stress}    values = {sign}{value}\n"))
        }
    };
    format!(
        "
  ! {}
  pure function {}(s, X, t) result(values)
    type(solution), intent(in) :: s
    real(dp), intent(in) :: X({d}), t
    real(dp) :: values{shape}
{lines}  end function
",
        item.about, item.name
    )
}

/// The lines by which user subroutines read the table, in the working folder of the job.
pub(in crate::targets) fn reading(code: &Code<'_>) -> String {
    if code.table.is_none() {
        return String::new();
    }
    format!(
        "    call read_table(s, {}, message)
    if (len(message) > 0) then
      write (*, \"(a)\") message
      error stop 2
    end if
",
        fortran_string(&code.table_file())
    )
}

//! Laws of algebra, derivatives and limits at random expressions. One program, so that what they share is compiled once.

mod algebra;
mod derivatives;
mod limits;

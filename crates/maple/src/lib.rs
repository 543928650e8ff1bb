//! C listings as Maple prints them.

//! Names that options, files and captions share.

use std::fmt;

/// Enums whose values have names that options, files and captions share, and a line about each: the first of its documentation.
macro_rules! named {
    ($(
        $(#[$of_enum:meta])*
        pub enum $Enum:ident {
            $(#[doc = $about:literal] $(#[doc = $more:literal])* $Value:ident = $name:literal,)+
        }
    )+) => {$(
        $(#[$of_enum])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $Enum {
            $(#[doc = $about] $(#[doc = $more])* $Value,)+
        }

        impl $Enum {
            /// All there are.
            pub const ALL: [Self; [$(Self::$Value),+].len()] = [$(Self::$Value),+];

            /// The name that the field has for it.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$Value => $name,)+
                }
            }

            /// A line about it.
            #[must_use]
            pub fn about(self) -> &'static str {
                match self {
                    $(Self::$Value => $about.trim_ascii(),)+
                }
            }
        }

        impl std::fmt::Display for $Enum {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl std::str::FromStr for $Enum {
            type Err = $crate::named::UnknownName;

            fn from_str(name: &str) -> Result<Self, $crate::named::UnknownName> {
                let known = || Self::ALL.map(Self::name).join(", ");
                Self::ALL
                    .into_iter()
                    .find(|value| value.name() == name)
                    .ok_or_else(|| $crate::named::UnknownName::among(known()))
            }
        }
    )+};
}

pub(crate) use named;

/// A name that nothing has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownName {
    /// The names that there are.
    known: String,
}

impl fmt::Display for UnknownName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "it must be one of {}", self.known)
    }
}

impl std::error::Error for UnknownName {}

impl UnknownName {
    /// A name that is none of these.
    pub(crate) fn among(known: String) -> Self {
        Self { known }
    }
}

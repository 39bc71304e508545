//! Enums whose variants have words, in one list.

/// Declares an enum, the list `ALL` of its variants, and the function that gives the words of each.
macro_rules! listed {
    ($(#[$about:meta])* $kind:ident, $words:ident $meaning:literal: $($(#[$note:meta])* $variant:ident $text:literal,)*) => {
        $(#[$about])*
        pub enum $kind {
            $(
                #[doc = $text]
                #[doc = ""]
                $(#[$note])*
                $variant,
            )*
        }

        impl $kind {
            /// All of them.
            pub const ALL: [Self; [$($text),*].len()] = [$(Self::$variant),*];

            #[doc = $meaning]
            pub fn $words(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)*
                }
            }
        }
    };
}

pub(crate) use listed;

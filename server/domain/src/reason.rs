//! Reasons of errors and refusals, as codes in capitals for programs. A code is the same in every version.

/// Declares an enum of reasons. Each variant has a description and a code. The code is the text that serde and
/// [`Display`](std::fmt::Display) write.
#[macro_export]
macro_rules! reasons {
    (
        $(#[$about:meta])*
        pub enum $name:ident { $($(#[$means:meta])+ $variant:ident = $word:literal,)+ }
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        pub enum $name {
            $($(#[$means])+ #[serde(rename = $word)] $variant,)+
        }

        impl $name {
            /// The code of the reason.
            #[must_use]
            pub fn as_str(self) -> &'static str {
                match self {
                    $(Self::$variant => $word,)+
                }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.as_str())
            }
        }
    };
}

//! Structs whose fields have defaults.

/// Defines a struct with default values next to its fields, and implements [`Default`].
///
/// ```
/// motorium_control::with_defaults! {
///     /// Limits of a base.
///     #[derive(Debug)]
///     pub struct Limits;
///
///     /// Largest speed \[m/s\].
///     pub speed: f64 = 0.5;
/// }
///
/// assert_eq!(Limits::default().speed, 0.5);
/// ```
#[macro_export]
macro_rules! with_defaults {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident;

        $( $(#[$field_meta:meta])* $field_vis:vis $field:ident: $type:ty = $default:expr; )*
    ) => {
        $(#[$meta])*
        $vis struct $name {
            $( $(#[$field_meta])* $field_vis $field: $type, )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $( $field: $default, )* }
            }
        }
    };
}

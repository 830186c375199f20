//! Structs whose fields have defaults.

/// Defines a struct with the default of each field next to the field, and implements [`Default`]; or defines a
/// constant with these values instead.
macro_rules! with_defaults {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident;

        $(#[$const_meta:meta])*
        $const_vis:vis const $constant:ident;

        $( $(#[$field_meta:meta])* $field_vis:vis $field:ident: $type:ty = $default:expr; )*
    ) => {
        $(#[$meta])*
        $vis struct $name {
            $( $(#[$field_meta])* $field_vis $field: $type, )*
        }

        $(#[$const_meta])*
        $const_vis const $constant: $name = $name { $( $field: $default, )* };
    };
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

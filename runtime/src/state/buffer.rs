//! Types that can be published on a topic, and the macro that defines them.

use iceoryx2::prelude::ZeroCopySend;

use super::{Field, TypeLayout};

/// A type that can be published on a topic.
///
/// Implemented by [`state_buffer!`](crate::state_buffer), which enforces the requirements: a permanent name,
/// `#[repr(C)]`, and fields that are all [`Field`]s.
pub trait StateBuffer: Field + ZeroCopySend {
    /// Name of the type for other languages and processes, such as `motorium.JointState`.
    const NAME: &'static str;

    /// Returns the layout of the type: its name, and the names, offsets and types of its fields.
    fn layout() -> TypeLayout;
}

impl TypeLayout {
    /// Returns the layout of the state buffer `T`.
    pub fn of<T: StateBuffer>() -> Self {
        let mut fields = Vec::new();
        T::describe("", 0, &mut fields);
        Self { type_name: T::NAME.to_string(), size: size_of::<T>(), alignment: align_of::<T>(), fields }
    }
}

macro_rules! number {
    ($($type:ident),*) => { $(
        impl StateBuffer for $type {
            const NAME: &'static str = stringify!($type);

            fn layout() -> TypeLayout {
                TypeLayout::of::<$type>()
            }
        }
    )* };
}

number!(f64, f32, u8, u16, u32, u64, i8, i16, i32, i64);

/// Defines a state buffer: a type that can be published on a topic.
///
/// Each field is a number, an array of numbers, or another state buffer. The type implements `Clone`, `Copy`,
/// `Debug`, `PartialEq`, `Default` (all zero) and [`StateBuffer`].
///
/// ```
/// motorium::state_buffer! {
///     /// Contact of one foot with the ground.
///     pub struct FootContact as "example.FootContact" {
///         /// Normal force, N.
///         pub normal_force: f64,
///         /// Centre of pressure in the foot frame, m.
///         pub centre_of_pressure: [f64; 2],
///     }
/// }
/// use motorium::state::StateBuffer;
/// assert_eq!(FootContact::layout().fields[1].offset, 8);
/// ```
#[macro_export]
macro_rules! state_buffer {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident as $type_name:literal {
            $( $(#[$field_meta:meta])* $field_vis:vis $field:ident : $field_type:ty ),* $(,)?
        }
    ) => {
        $crate::state_buffer! {
            @layout $(#[$meta])*
            $vis struct $name as $type_name { $( $(#[$field_meta])* $field_vis $field : $field_type ),* }
        }

        #[allow(unsafe_code)]
        // SAFETY: `repr(C)`, and every field is itself a `Field`.
        unsafe impl $crate::state::Field for $name {
            const ZERO: Self = Self { $( $field: <$field_type as $crate::state::Field>::ZERO ),* };
            const NUMBERS: $crate::state::Numbers =
                $crate::state::Numbers::concat(&[$( <$field_type as $crate::state::Field>::NUMBERS ),*]);

            fn describe(prefix: &str, offset: usize, out: &mut Vec<$crate::state::FieldLayout>) {
                $crate::state_buffer!(@describe $name, prefix, offset, out, $( $field : $field_type ),*);
            }

            fn check(&self) -> Result<(), $crate::state::Defect> {
                $( $crate::state::Field::check(&self.$field).map_err(|defect| defect.inside(stringify!($field)))?; )*
                Ok(())
            }

            #[inline]
            fn check_rest(&self, checked: &$crate::state::Checked) -> Result<(), $crate::state::Defect> {
                $( $crate::state::Field::check_rest(&self.$field, checked)
                    .map_err(|defect| defect.inside(stringify!($field)))?; )*
                Ok(())
            }

            fn digest(&self, digest: &mut $crate::state::Digest) {
                $( $crate::state::Field::digest(&self.$field, digest); )*
            }
        }
    };
    (
        @layout $(#[$meta:meta])*
        $vis:vis struct $name:ident as $type_name:literal {
            $( $(#[$field_meta:meta])* $field_vis:vis $field:ident : $field_type:ty ),* $(,)?
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[repr(C)]
        $vis struct $name {
            $( $(#[$field_meta])* $field_vis $field : $field_type ),*
        }

        #[allow(unsafe_code)]
        // SAFETY: `repr(C)`, `'static`, no pointers and no `Drop`, since every field is a `Field`.
        unsafe impl $crate::state::__ZeroCopySend for $name {
            unsafe fn type_name() -> &'static str {
                $type_name
            }
        }

        impl $crate::state::StateBuffer for $name {
            const NAME: &'static str = $type_name;

            fn layout() -> $crate::state::TypeLayout {
                $crate::state::TypeLayout::of::<$name>()
            }
        }

        impl Default for $name {
            fn default() -> Self {
                <Self as $crate::state::Field>::ZERO
            }
        }
    };
    (@describe $name:ident, $prefix:ident, $offset:ident, $out:ident, $( $field:ident : $field_type:ty ),*) => {
        $(
            let path = if $prefix.is_empty() {
                stringify!($field).to_string()
            } else {
                format!("{}.{}", $prefix, stringify!($field))
            };
            <$field_type as $crate::state::Field>::describe(
                &path,
                $offset + core::mem::offset_of!($name, $field),
                $out,
            );
        )*
    };
}

//! State buffers with counted arrays.

/// Defines a state buffer whose arrays have `capacity` entries each, of which the first `count` are in use.
///
/// The buffer starts with `count` and a reserved word, so that the rest is aligned to eight bytes without
/// padding, followed by the `plain` fields and the arrays. Entries beyond the count are not checked, not part
/// of a digest, and not shown.
macro_rules! counted_buffer {
    (
        $(#[$meta:meta])*
        pub struct $name:ident as $type_name:literal, at most $capacity:ident {
            $( plain { $( $(#[$plain_meta:meta])* $plain:ident : $plain_type:ty; )* } )?
            counted { $( $(#[$doc:meta])* $field:ident, $field_mut:ident : $type:ty; )* }
        }
    ) => {
        $crate::state_buffer! {
            @layout
            $(#[$meta])*
            pub struct $name as $type_name {
                count: u32,
                reserved: u32,
                $( $( $(#[$plain_meta])* pub $plain: $plain_type, )* )?
                $( $field: [$type; $capacity], )*
            }
        }

        impl $name {
            /// Returns the number of entries in use, at most the capacity of the arrays.
            pub fn count(&self) -> usize {
                (self.count as usize).min($capacity)
            }

            /// Sets the number of entries in use. Added entries keep the content that the buffer had there
            /// before.
            ///
            /// # Panics
            /// If `count` exceeds the capacity of the arrays; check sizes during configuration.
            pub fn set_count(&mut self, count: usize) {
                assert!(count <= $capacity, "{count} entries, but a buffer holds {}", $capacity);
                self.count = count as u32;
            }

            $(
                $(#[$doc])*
                pub fn $field(&self) -> &[$type] {
                    &self.$field[..self.count()]
                }

                $(#[$doc])*
                pub fn $field_mut(&mut self) -> &mut [$type] {
                    let count = self.count();
                    &mut self.$field[..count]
                }
            )*
        }

        // SAFETY: `repr(C)`, and every field is itself a `Field`.
        unsafe impl $crate::state::Field for $name {
            const ZERO: Self = Self {
                count: 0,
                reserved: 0,
                $( $( $plain: <$plain_type as $crate::state::Field>::ZERO, )* )?
                $( $field: [<$type as $crate::state::Field>::ZERO; $capacity], )*
            };

            fn describe(prefix: &str, offset: usize, out: &mut Vec<$crate::state::FieldLayout>) {
                let first = out.len();
                $crate::state_buffer!(@describe $name, prefix, offset, out,
                    count: u32, reserved: u32
                    $( $( , $plain: $plain_type )* )?
                    $( , $field: [$type; $capacity] )*);
                let path = |name: &str| match prefix {
                    "" => name.to_string(),
                    prefix => format!("{prefix}.{name}"),
                };
                let counted = [$( path(stringify!($field)) ),*];
                for field in out[first..].iter_mut().filter(|field| counted.contains(&field.name)) {
                    field.count = Some(path("count"));
                }
            }

            fn check(&self) -> Result<(), $crate::state::Defect> {
                self.check_rest(&$crate::state::Checked::default())
            }

            #[inline]
            fn check_rest(&self, checked: &$crate::state::Checked) -> Result<(), $crate::state::Defect> {
                let count = self.count as usize;
                if count > $capacity {
                    return Err($crate::state::Defect::Count { field: "count", found: count, capacity: $capacity });
                }
                $( $(
                    $crate::state::Field::check(&self.$plain).map_err(|defect| defect.inside(stringify!($plain)))?;
                )* )?
                $(
                    if !checked.covers(&self.$field[..count]) {
                        <$type as $crate::state::Field>::check_all(&self.$field[..count])
                            .map_err(|defect| defect.inside(stringify!($field)))?;
                    }
                )*
                Ok(())
            }

            fn digest(&self, digest: &mut $crate::state::Digest) {
                digest.write_u64(u64::from(self.count));
                $( $( $crate::state::Field::digest(&self.$plain, digest); )* )?
                $( <$type as $crate::state::Field>::digest_all(self.$field(), digest); )*
            }
        }
    };
}

pub(super) use counted_buffer;

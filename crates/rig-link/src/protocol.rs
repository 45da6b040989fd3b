//! The hash by which a tool and a firmware recognise that they have the same messages.

use crate::messages::{Message, Request};
use postcard_schema::Schema;
use postcard_schema::key::hash::fnv1a64::hash_ty_path;

/// Raised when the framing changes; the messages themselves are covered by their schema.
const FRAMING: &str = "framing 1";

/// Hash of the types, names and order of all fields and variants of all messages, and of the framing. Comments, the
/// layout of the source and the names of types do not count.
pub const PROTOCOL_HASH: u32 = schema_hash::<(Request, Message)>();

/// The 64-bit hash of postcard-schema, folded. It is computed by the compiler and takes no room on the board.
const fn schema_hash<T: Schema>() -> u32 {
    let hash = u64::from_le_bytes(hash_ty_path::<T>(FRAMING));
    hash as u32 ^ (hash >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::{FRAMING, Message, Request, Schema, hash_ty_path, schema_hash};

    macro_rules! hash {
        ($($body:tt)*) => {{
            #[allow(dead_code)]
            #[derive(Schema)]
            $($body)*
            schema_hash::<T>()
        }};
    }

    #[test]
    fn both_halves_of_the_long_hash_count() {
        let long = hash_ty_path::<(Request, Message)>(FRAMING);
        let folded: [u8; 4] = core::array::from_fn(|k| long[k] ^ long[k + 4]);
        assert_eq!(schema_hash::<(Request, Message)>().to_le_bytes(), folded);
    }

    #[rustfmt::skip]
    #[test]
    fn the_hash_follows_names_order_types_and_number_of_fields_and_variants_and_nothing_else() {
        let base = hash!(struct T { speed_m_per_s: f32, tries: u8 });
        for (changed, what) in [
            (hash!(struct T { speed_rad_per_s: f32, tries: u8 }), "another name"),
            (hash!(struct T { tries: u8, speed_m_per_s: f32 }), "another order"),
            (hash!(struct T { speed_m_per_s: f64, tries: u8 }), "another type"),
            (hash!(struct T { speed_m_per_s: f32, tries: Option<u8> }), "another type"),
            (hash!(struct T { speed_m_per_s: f32, tries: u8, last: bool }), "one more"),
        ] {
            assert_ne!(base, changed, "{what}");
        }
        assert_ne!(hash!(struct T { texts: [f32; 3] }), hash!(struct T { texts: [f32; 4] }), "another length");
        assert_eq!(base, hash!(
            /// A comment.
            struct T {
                /// How fast (m/s).
                speed_m_per_s: f32,
                // How often.
                tries: u8,
            }
        ));
        let base = hash!(enum T { Home, Jog { speed: f32 }, Stop });
        for (changed, what) in [
            (hash!(enum T { Home, Jog { speed: f32 }, Halt }), "another name"),
            (hash!(enum T { Jog { speed: f32 }, Home, Stop }), "another order"),
            (hash!(enum T { Home, Jog { speed: f64 }, Stop }), "another type"),
            (hash!(enum T { Home, Jog { speed: f32 } }), "one less"),
        ] {
            assert_ne!(base, changed, "{what}");
        }
    }
}

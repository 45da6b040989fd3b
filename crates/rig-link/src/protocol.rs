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

    #[test]
    fn the_hash_follows_fields_and_their_order_and_types() {
        let base = hash!(
            struct T {
                speed_m_per_s: f32,
                tries: u8,
            }
        );
        assert_ne!(
            base,
            hash!(
                struct T {
                    speed_rad_per_s: f32,
                    tries: u8,
                }
            ),
            "another name"
        );
        assert_ne!(
            base,
            hash!(
                struct T {
                    tries: u8,
                    speed_m_per_s: f32,
                }
            ),
            "another order"
        );
        assert_ne!(
            base,
            hash!(
                struct T {
                    speed_m_per_s: f64,
                    tries: u8,
                }
            ),
            "another type"
        );
        assert_ne!(
            base,
            hash!(
                struct T {
                    speed_m_per_s: f32,
                    tries: Option<u8>,
                }
            ),
            "another type"
        );
        assert_ne!(
            base,
            hash!(
                struct T {
                    speed_m_per_s: f32,
                    tries: u8,
                    last: bool,
                }
            ),
            "one more"
        );
        assert_ne!(
            hash!(
                struct T {
                    texts: [f32; 3],
                }
            ),
            hash!(
                struct T {
                    texts: [f32; 4],
                }
            ),
            "another length"
        );
    }

    #[test]
    fn the_hash_follows_variants_and_their_order_and_contents() {
        let base = hash!(
            enum T {
                Home,
                Jog { speed: f32 },
                Stop,
            }
        );
        assert_ne!(
            base,
            hash!(
                enum T {
                    Home,
                    Jog { speed: f32 },
                    Halt,
                }
            ),
            "another name"
        );
        assert_ne!(
            base,
            hash!(
                enum T {
                    Jog { speed: f32 },
                    Home,
                    Stop,
                }
            ),
            "another order"
        );
        assert_ne!(
            base,
            hash!(
                enum T {
                    Home,
                    Jog { speed: f64 },
                    Stop,
                }
            ),
            "another type"
        );
        assert_ne!(
            base,
            hash!(
                enum T {
                    Home,
                    Jog { speed: f32 },
                }
            ),
            "one less"
        );
    }

    #[test]
    fn the_hash_does_not_follow_comments_or_layout() {
        let base = hash!(
            struct T {
                speed: f32,
                tries: u8,
            }
        );
        let same = hash!(
            /// A comment.
            struct T {
                /// How fast (m/s).
                speed: f32,
                // How often.
                tries: u8,
            }
        );
        assert_eq!(base, same);
    }
}

//! Parts for tests and measurements of components and of the transport. Feature `testing`.

mod topics;

pub use topics::{Endpoint, TopicSet, TopicSetError};

//! System identification: the parameters of an ego, from runs of it alone.

mod ego_conditioning;
mod error;
mod identification_cache;
mod identified_ego;
mod identify;
mod recording;

pub use ego_conditioning::{ConditionedAdo, ContextSource, LEAST_RUNS, RECORDED_RUNS, conditioned};
pub use error::ConditioningError;
pub(crate) use identification_cache::{DIR, place_of};
pub use identified_ego::{FoundParameter, IdentifiedAs};
pub use identify::{Identified, IdentifyError, identify, is_telling};
pub use recording::IdentifyRequest;

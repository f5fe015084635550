//! System identification: the parameters of an ego, from runs of it alone.

mod ego_conditioning;
mod ego_recording;
mod identify;

pub(crate) use ego_conditioning::LEAST_RUNS;
pub use ego_conditioning::{
    ConditionedAdo, ConditioningError, ContextSource, FoundParameter, IdentifiedAs, RECORDED_RUNS,
    conditioned,
};
pub(crate) use ego_conditioning::{DIR, place_of};
pub use identify::{Identified, IdentifyError, IdentifyRequest, describes, identify};

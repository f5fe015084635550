//! Request of a search.

use super::list::Method;
use crate::experiment::TestStarts;
use crate::world::Scenario;

/// World, ego, method and starts of a search.
#[derive(Clone, Copy)]
pub struct SearchRequest<'a> {
    /// World with the ego under test.
    pub scenario: &'a Scenario,
    /// Name of the ego in rows.
    pub ego: &'a str,
    /// Method by which sequences are chosen.
    pub method: Method<'a>,
    /// Simulations per start. 0 for methods without a budget.
    pub budget: u64,
    /// The test starts.
    pub starts: &'a TestStarts,
}

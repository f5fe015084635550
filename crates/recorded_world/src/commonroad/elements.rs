//! Numbers, places and references in the elements of a scenario.

use crate::opendrive::ImportError;
use crate::opendrive::tree::XmlNode;

/// Distance from the origin beyond which nothing on Earth is.
const FARTHEST_M: f64 = 1.0e8;
/// Characters of a text in a message.
const SHOWN_CHARS: usize = 40;

/// Returns the words of an element, cut for a message.
pub(super) fn shown(node: &XmlNode) -> String {
    node.words.chars().take(SHOWN_CHARS).collect()
}

/// Returns the finite number in an element.
pub(super) fn number(node: &XmlNode) -> Result<f64, ImportError> {
    let value = node.words.parse().ok().filter(|it: &f64| it.is_finite());
    value.ok_or_else(|| {
        let what = format!("`{}` is not a finite number", shown(node));
        node.refused(what, "write a number")
    })
}

/// Returns the number in a child of a name.
pub(super) fn number_in(node: &XmlNode, name: &str) -> Result<f64, ImportError> {
    number(node.inner(name)?)
}

/// Returns the positive number in a child of a name.
pub(super) fn positive_in(node: &XmlNode, name: &str) -> Result<f64, ImportError> {
    let child = node.inner(name)?;
    let value = number(child)?;
    if value > 0.0 {
        return Ok(value);
    }
    Err(child.refused(
        format!("{value} is not positive"),
        "write a positive number",
    ))
}

/// Returns the coordinates in metres of an element with `x` and `y`.
pub(super) fn point(node: &XmlNode) -> Result<[f64; 2], ImportError> {
    let point_m = [number_in(node, "x")?, number_in(node, "y")?];
    match point_m.iter().find(|it| it.abs() > FARTHEST_M) {
        None => Ok(point_m),
        Some(far_m) => {
            let what = format!("{far_m:e} m from the origin is nowhere on Earth");
            Err(node.refused(what, "write metres"))
        }
    }
}

/// Returns the points of an element.
pub(super) fn points(node: &XmlNode) -> Result<Vec<[f64; 2]>, ImportError> {
    node.all("point").map(point).collect()
}

/// Returns the value of a quantity that must be exact, `None` without the quantity.
///
/// A value within an interval would be a guess, so intervals are refused.
pub(super) fn exact(state: &XmlNode, name: &str) -> Result<Option<f64>, ImportError> {
    let Some(node) = state.child(name) else {
        return Ok(None);
    };
    match node.child("exact") {
        Some(value) => number(value).map(Some),
        None => {
            let what = "it has no exact value";
            let help = "write `exact`: a value of an interval would be a guess";
            Err(node.refused(what, help))
        }
    }
}

/// Returns the exact value of a quantity that a state must have.
pub(super) fn needed(state: &XmlNode, name: &str) -> Result<f64, ImportError> {
    exact(state, name)?.ok_or_else(|| {
        let help = format!("add a `{name}` with `exact`");
        state.refused(format!("there is no `{name}` in it"), &help)
    })
}

/// Returns the exact position of a state.
pub(super) fn position(state: &XmlNode) -> Result<[f64; 2], ImportError> {
    let node = state.inner("position")?;
    match node.child("point") {
        Some(at) => point(at),
        None => {
            let what = "its position is a region";
            let help = "write `point`: a place in a region would be a guess";
            Err(node.refused(what, help))
        }
    }
}

/// Least and greatest value of a quantity: equal for an exact one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ValueRange {
    pub(super) least: f64,
    pub(super) most: f64,
}

/// Returns the interval of a quantity, `None` without the quantity.
pub(super) fn interval(state: &XmlNode, name: &str) -> Result<Option<ValueRange>, ImportError> {
    let Some(node) = state.child(name) else {
        return Ok(None);
    };
    // An exact value is the interval of that value alone.
    if node.child("exact").is_some() {
        let value = number_in(node, "exact")?;
        return Ok(Some(ValueRange {
            least: value,
            most: value,
        }));
    }
    let (least, most) = (
        number_in(node, "intervalStart")?,
        number_in(node, "intervalEnd")?,
    );
    // Reversed bounds would make a formula that nothing can satisfy.
    if most < least {
        let what = format!("the interval from {least} to {most} is reversed");
        return Err(node.refused(what, "write the lower value as `intervalStart`"));
    }
    Ok(Some(ValueRange { least, most }))
}

/// Returns the identities that children of a name refer to.
pub(super) fn references(node: &XmlNode, name: &str) -> Result<Vec<String>, ImportError> {
    let found = node.all(name).map(|it| it.need("ref").map(str::to_owned));
    found.collect()
}

/// Returns the identity of an element.
pub(super) fn identity(node: &XmlNode) -> Result<String, ImportError> {
    node.need("id").map(str::to_owned)
}

#![cfg(test)]
//! The list for users has each row of the list of signals.

use std::collections::BTreeSet;

use super::*;

#[test]
fn every_signal_has_a_line_with_a_meaning() {
    let list = signal_list();
    let names: BTreeSet<&str> = list.iter().map(|(it, _)| it.name.as_str()).collect();
    assert_eq!(names.len(), SIGNALS.len());
    for (signal, _) in &list {
        assert!(signal.about.len() > 5, "`{}` has no meaning", signal.name);
        assert!(!signal.about.contains('{'), "{}", signal.about);
    }
    for name in ["time", "A.B.gap", "A.L.line", "W.friction", "R.ahead", "P"] {
        assert!(names.contains(name), "{name}: {names:?}");
    }
}

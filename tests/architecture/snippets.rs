//! What the floors and circles are read from, on small sources.

use super::circles::circles;
use super::names;
use super::sources::Sources;
use super::upward;

/// A library of four modules; the code stands in `src/sim/rigid/mod.rs`.
fn with(code: &str) -> Sources {
    Sources::read(&[
        (
            "src/lib.rs",
            "pub mod cli; pub mod campaign; pub mod seed; pub mod sim; pub use brakecheck_stl as stl; pub use cli::Exit as Left;",
        ),
        (
            "src/cli/mod.rs",
            "mod terminal; pub use terminal::say; pub struct Exit;",
        ),
        (
            "src/cli/terminal.rs",
            "pub fn say() {} macro_rules! m { () => {} }",
        ),
        ("src/campaign/mod.rs", "pub struct Watch;"),
        ("src/seed.rs", "pub struct Seed;"),
        ("src/sim/mod.rs", "pub mod rigid; pub struct Body;"),
        ("src/sim/rigid/mod.rs", code),
        (
            "crates/stl/src/lib.rs",
            "pub mod trace; pub struct Formula;",
        ),
        ("crates/stl/src/trace.rs", "pub struct Trace;"),
    ])
}

#[test]
fn an_upward_use_is_seen_however_it_is_written() {
    for code in [
        "use crate::{campaign::Watch, cli::Exit};",
        "use crate::{sim::{Body}, cli};",
        "use crate::{self as all, sim::Body}; fn f(_: all::cli::Exit) {}",
        "use crate as b; use b::cli as x;",
        "use crate as b; fn f() { b::cli::say() }",
        "extern crate self as b; fn f() { b::cli::say() }",
        "use super::super::cli;",
        "use super::super as all; use all::campaign;",
        "mod inner { use super::super::super::cli::Exit; }",
        "use crate::*; fn f() { cli::say() }",
        "use super::super::*; fn f() -> cli::Exit { loop {} }",
        "use crate::Left;",
        "pub(crate) use crate::cli::say;",
        "fn f() { crate::cli::say() }",
        "fn f() { use crate::cli::*; }",
        "fn f(_: &[Vec<crate::campaign::Watch>]) {}",
        "impl From<crate::cli::Exit> for u8 {}",
        "fn f(a: u8) { match a { crate::cli::MOST => {} _ => {} } }",
        "fn f() { println!(\"{}\", crate::cli::say()) }",
        "macro_rules! m { () => { $crate::cli::say() } }",
        "macro_rules! m { () => { use crate::{sim, cli::{Exit}}; } }",
        "#[derive(Serialize)] struct A { #[serde(with = \"crate::cli\")] b: u8 }",
        "#[cfg(not(test))] use crate::cli;",
        "#[cfg(any(test, unix))] use crate::cli;",
        "use crate::stl::Formula;",
        "use brakecheck_stl::Formula;",
        "use brakecheck_stl as logic; fn f(_: logic::trace::Trace) {}",
    ] {
        let wrong = upward(&with(code));
        assert!(!wrong.is_empty(), "{code}");
        assert!(
            wrong
                .iter()
                .all(|w| w.starts_with("src/sim/rigid/mod.rs:1: ")),
            "{code}: {wrong:?}"
        );
    }
}

#[test]
fn what_is_below_beside_or_for_tests_is_no_upward_use() {
    for code in [
        "use crate::sim::Body; use super::Body as B; use self::inner::C; mod inner { pub struct C; }",
        "use std::{fs, time}; use rand::rand; use serde::Serialize;",
        "fn f() { let cli = 1; g(cli); campaign(cli) } fn campaign() {}",
        "/// [`Exit`](crate::cli::Exit)\npub(crate) fn f() { other::cli::say() }",
        "struct A { cli: u8 } fn f(a: A) { a.cli; \"crate::cli and more\"; }",
        "#[cfg(test)] use crate::cli;",
        "#[cfg(test)] mod tests { use crate::cli; }",
        "#[cfg(all(test, unix))] fn f() { crate::cli::say() }",
        "struct A; impl A { #[cfg(test)] fn f() { crate::cli::say() } }",
        "#[test] fn f() { crate::cli::say() }",
        "#![cfg(test)] use crate::cli;",
        "fn f() { vec![a::b, c::<d>::e]; m!(x::{y, z}) }",
    ] {
        let wrong = upward(&with(code));
        assert!(wrong.is_empty(), "{code}: {wrong:?}");
    }
}

#[test]
fn a_module_in_a_file_of_its_own_may_be_for_tests() {
    let sources = Sources::read(&[
        ("src/lib.rs", "pub mod cli; pub mod sim;"),
        ("src/cli.rs", "pub struct Exit;"),
        ("src/sim/mod.rs", "#[cfg(test)] mod checks;"),
        ("src/sim/checks.rs", "use crate::cli::Exit;"),
    ]);
    assert!(upward(&sources).is_empty());
}

/// The circles of `src/rl`, without directory and ending.
fn circles_of(texts: &[(&str, &str)]) -> Vec<Vec<String>> {
    let sources = Sources::read(texts);
    let name = |file: &usize| {
        sources.files[*file]
            .replace("src/rl/", "")
            .replace(".rs", "")
    };
    let mut found = circles(&sources, "src/rl/");
    found.sort();
    found
        .iter()
        .map(|circle| circle.iter().map(name).collect())
        .collect()
}

#[test]
fn circles_of_files_are_found_through_whatever_leads_on() {
    let root = ("src/lib.rs", "pub mod rl;");
    let head = (
        "src/rl/mod.rs",
        "mod a; mod b; mod c; pub use a::A; pub use b::B; pub use c::C;",
    );
    let cases: [([&str; 3], &[&[&str]]); 9] = [
        (
            [
                "use super::b::B; pub struct A;",
                "pub struct B;",
                "use super::b::B; pub struct C;",
            ],
            &[],
        ),
        (
            [
                "use super::b::B; pub struct A;",
                "use crate::rl::a::A; pub struct B;",
                "pub struct C;",
            ],
            &[&["a", "b"]],
        ),
        (
            [
                "use super::B; pub struct A;",
                "use crate::rl::C; pub struct B;",
                "pub struct C(super::A);",
            ],
            &[&["a", "b", "c"]],
        ),
        (
            [
                "use super::*; pub struct A(B);",
                "pub struct B(crate::rl::A);",
                "pub struct C;",
            ],
            &[&["a", "b"]],
        ),
        (
            [
                "pub use super::b::B; pub struct A;",
                "pub struct B;",
                "pub struct C; fn f() { super::a::B::new() }",
            ],
            &[],
        ),
        (
            [
                "pub struct A(super::c::C);",
                "pub struct B;",
                "use super::a; pub struct C; fn f() { a::g() }",
            ],
            &[&["a", "c"]],
        ),
        (
            [
                "pub struct A; #[cfg(test)] mod t { use super::super::B; }",
                "use super::A; pub struct B;",
                "pub struct C;",
            ],
            &[],
        ),
        (
            [
                "pub struct A; fn f(b: u8) { b }",
                "use super::A; pub struct B;",
                "pub struct C;",
            ],
            &[],
        ),
        (
            [
                "pub struct A(super::Ghost);",
                "use super::A; pub struct B;",
                "pub struct C;",
            ],
            &[],
        ),
    ];
    for ([a, b, c], expected) in cases {
        let texts = [
            root,
            head,
            ("src/rl/a.rs", a),
            ("src/rl/b.rs", b),
            ("src/rl/c.rs", c),
        ];
        assert_eq!(circles_of(&texts), expected, "{a}\n{b}\n{c}");
    }
}

#[test]
fn code_of_a_head_file_counts_and_its_list_of_modules_does_not() {
    let root = ("src/lib.rs", "pub mod rl;");
    let child = ("src/rl/a.rs", "use super::Head; pub struct A;");
    let cases: [(&str, &[[&str; 2]]); 2] = [
        ("mod a; pub use a::A; pub struct Head;", &[]),
        ("mod a; use a::A; pub struct Head(A);", &[["a", "mod"]]),
    ];
    for (head, expected) in cases {
        assert_eq!(
            circles_of(&[root, child, ("src/rl/mod.rs", head)]),
            expected,
            "{head}"
        );
    }
}

#[test]
fn a_name_of_private_types_in_two_files_is_seen() {
    let shared = |code: &str| {
        let texts = [("src/sim/mod.rs", "struct Body;"), ("src/rl/mod.rs", code)];
        names::in_several_files(&texts).len()
    };
    for code in [
        "struct Body;",
        "pub(super) enum Body {}",
        "mod inner { trait Body {} }",
        "fn f() { type Body = u8; }",
    ] {
        assert_eq!(shared(code), 1, "{code}");
    }
    for code in [
        "struct Bodies;",
        "use crate::sim::Body;",
        "impl Iterator for Own { type Body = u8; }",
        "#[cfg(test)] mod tests { struct Body; }",
    ] {
        assert_eq!(shared(code), 0, "{code}");
    }
}

#[test]
fn a_name_of_two_public_types_is_seen_wherever_they_stand() {
    let twice = |code: &str| {
        let texts = [
            ("src/lib.rs", "pub mod sim; pub use sim::Body;"),
            ("src/sim/mod.rs", "pub struct Body;"),
            ("src/sim/rigid.rs", code),
            ("crates/stl/src/lib.rs", "pub enum Formula {}"),
        ];
        names::twice(&Sources::read(&texts), &texts)
    };
    for code in [
        "pub struct Body { x_m: f64 }",
        "pub enum Formula { None }",
        "pub trait Body {}",
        "pub type Body = u8;",
        "mod inner { pub union Body { x: u8 } }",
        "bodies! { #[doc = \"One.\"] pub struct Body { x_m } }",
        "macro_rules! m { ($a:ident) => { #[derive(Debug)] pub enum Body { $a } } }",
        "pub struct Own; macro_rules! m { () => { pub struct Own; } }",
    ] {
        let found = twice(code);
        assert_eq!(found.len(), 1, "{code}: {found:?}");
        assert!(found.values().all(|places| places.len() == 2), "{found:?}");
    }
    for code in [
        "struct Body;",
        "pub(crate) struct Body; pub(super) enum Formula {}",
        "pub use super::Body; pub fn body(body: Body) {}",
        "#[cfg(test)] mod tests { pub struct Body; }",
        "#[cfg(test)] pub struct Body;",
        "#![cfg(test)] pub struct Body;",
        "macro_rules! m { ($kind:ident) => { pub struct $kind; } }",
        "pub enum Motion { Body(Body) } m!(Body);",
    ] {
        assert!(twice(code).is_empty(), "{code}: {:?}", twice(code));
    }
}

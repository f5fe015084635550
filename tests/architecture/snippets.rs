//! What circles and names are read from, on small sources.

use super::circles::circles;
use super::names;
use super::sources::Sources;

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

//! Prints the crates of the workspace as the graph of ARCHITECTURE.md.
//!
//! The test of the architecture compares that page with the same graph.

mod crates_graph;

fn main() {
    print!("{}", crates_graph::mermaid());
}

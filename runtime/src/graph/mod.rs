//! The graph file: parsed, resolved, checked, with every mistake shown in its place.

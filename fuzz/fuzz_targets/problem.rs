//! Fuzzes the reader of problems from JSON.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Problem);

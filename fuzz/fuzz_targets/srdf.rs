//! Fuzzes the reader of named positions from SRDF.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Srdf);

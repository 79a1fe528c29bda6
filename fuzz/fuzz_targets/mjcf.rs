//! Fuzzes the reader of robots from MJCF.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Mjcf);

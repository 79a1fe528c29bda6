//! Both back ends on the same programs.

mod closed_forms;

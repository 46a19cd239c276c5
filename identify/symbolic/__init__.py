"""The models of Khalil & Dombre, chapter 2, exact: knows no numbers."""

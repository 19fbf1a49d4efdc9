"""The paper's claims: what each is measured by, the stages it is judged over, and what becomes of it."""

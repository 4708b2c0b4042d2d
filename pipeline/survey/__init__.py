"""Stage 1: what is detected of a survey, and the plan, workings, floors and legs that its content makes."""

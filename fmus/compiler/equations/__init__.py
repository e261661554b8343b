"""Turns a file of declared equations into the source of a scalar model class.

    expressions.py              expressions and their functions
    model_declaration.py        variables, rules and the base class of models
    tables.py                   lookup tables
    model_file.py               loads a model file and reports errors with file and line
    algebra.py                  substitution, differentiation, solving for a variable, rounding scales
    model_conditions.py         conditions of the equations that may change during a step
    model_roles.py, declaration_checks.py, contact_analysis.py, model_analysis.py
                                structural analysis: roles of variables, contact loads, applicable solvers
    dimensions.py               checks the units of expressions
    start_values.py             checks the values of equations, rules and friction forces at the start
    python_errors.py            explains Python exceptions in model files
    reserved_names.py           names reserved by generated models and in C
    expression_printer.py       prints expressions as Python statements
    codegen_context.py          shared by the generators of methods
    setup_methods.py, rate_methods.py, contact_methods.py, output_methods.py
                                generate the methods of a model class
    model_class.py              generates the module

In these modules e is an expression, s a state, and c and d are contacts; `by` gives the derivatives of the variables
along which an expression is differentiated.

Terms are not regrouped: (F_ext + F_spring - F_friction) / m is evaluated in the order in which it is written.
"""

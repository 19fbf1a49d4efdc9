"""Results of questions, declared once as `Quantity` attributes of a subclass of `Result`.

Tables, JSON documents with their schema, columns of studies, the reference in the documentation and
the gates of `regression` follow from the declaration.
"""

from flexfem.results.declare import ANALYTIC as ANALYTIC
from flexfem.results.declare import AXES as AXES
from flexfem.results.declare import COARSE_MESHES as COARSE_MESHES
from flexfem.results.declare import ELEMENTS as ELEMENTS
from flexfem.results.declare import EXACT as EXACT
from flexfem.results.declare import MAGNITUDE as MAGNITUDE
from flexfem.results.declare import NEW_MESH as NEW_MESH
from flexfem.results.declare import SHEET as SHEET
from flexfem.results.declare import SOLID as SOLID
from flexfem.results.declare import SOLVED as SOLVED
from flexfem.results.declare import STRESS as STRESS
from flexfem.results.declare import About as About
from flexfem.results.declare import Arrays as Arrays
from flexfem.results.declare import Fields as Fields
from flexfem.results.declare import Gate as Gate
from flexfem.results.declare import Number as Number
from flexfem.results.declare import Progress as Progress
from flexfem.results.declare import Quantity as Quantity
from flexfem.results.declare import Scale as Scale
from flexfem.results.numbers import SPACE as SPACE
from flexfem.results.numbers import number as number
from flexfem.results.numbers import thousands as thousands
from flexfem.results.records import Ends as Ends
from flexfem.results.records import record_parts as record_parts
from flexfem.results.render import FLOOR as FLOOR
from flexfem.results.render import TextTable as TextTable
from flexfem.results.render import html_table as html_table
from flexfem.results.result import Result as Result
from flexfem.results.store import DRAFT as DRAFT
from flexfem.results.store import FORMAT as FORMAT
from flexfem.results.store import LARGEST_FILE as LARGEST_FILE
from flexfem.results.store import PACKAGES as PACKAGES
from flexfem.results.store import unsealed as unsealed
from flexfem.results.store import versions as versions
from flexfem.results.store import write_sealed as write_sealed
